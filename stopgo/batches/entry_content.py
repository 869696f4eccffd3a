"""Content that an entry's plan was made of, with what had changed when it was planned."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from stopgo.batches.content import changes
from stopgo.batches.store import Result
from stopgo.mission.document.decoding import decoded

ENTRY_FILE = "content.json"


class EntryContent(msgspec.Struct, frozen=True, kw_only=True):
    """Content that an entry's plan was made of, and what had changed when it was made."""

    key: str
    parts: dict[str, str]
    settings: dict[str, Any]
    computed_by: str
    reasons: list[str]


def entry_content(key: str, result: Result, before: EntryContent | None) -> EntryContent:
    """Return the content of a result, with the reasons why it is not that of before."""
    now = EntryContent(
        key=key,
        parts=result.parts,
        settings=result.settings,
        computed_by=result.computed_by,
        reasons=[],
    )
    if before is not None and before.key == now.key:
        return before
    return msgspec.structs.replace(now, reasons=differences(before, now))


def differences(before: EntryContent | None, now: EntryContent) -> list[str]:
    """Return what differs between two contents of an entry, one line each."""
    if before is None:
        return ["planned for the first time"]
    lines = changes(before.parts, now.parts)
    values = (_as_text(before.settings), _as_text(now.settings))
    lines += [f"option {line}" for line in changes(*values)]
    if before.computed_by != now.computed_by:
        lines.append(f"computed by {now.computed_by}; before by {before.computed_by}")
    return lines


def _as_text(settings: Mapping[str, Any]) -> dict[str, str]:
    return {name: msgspec.json.encode(value).decode() for name, value in settings.items()}


def read_content(folder: Path) -> EntryContent | None:
    """Return the content that the plan in an entry's folder was made of; None if there is none."""
    try:
        return decoded((folder / ENTRY_FILE).read_bytes(), EntryContent)
    except (OSError, msgspec.DecodeError):
        return None

"""The example of protocol.md is what our code reads and writes, to the byte."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.link.protocol import Commit, KeyExpressions, Manifest, Reply, encode
from stopgo.mission.run.events import AnyEvent, PoseReport, StateReport
from stopgo.mission.run.run_commands import RunCommand

TEXT = (Path(__file__).parents[3] / "docs" / "reference" / "protocol.md").read_text(encoding="utf-8")
(BLOCK,) = re.findall(r"^## An example\n.*?^```\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
KINDS: dict[str, Any] = {
    "->": Manifest | Commit | RunCommand, "<-": Reply, "tel/state": StateReport, "tel/pose": PoseReport,
    "tel/event": AnyEvent,
}  # fmt: skip


def said() -> list[tuple[str, str, str]]:
    """Key, arrow and JSON of every message."""
    found, key = [], ""
    for line in BLOCK.splitlines():
        arrow, _, payload = line.partition(" ")
        if arrow not in ("->", "<-", "=>"):
            key = line
        elif payload.startswith("{"):
            found.append((key, arrow, payload))
    return found


@pytest.mark.parametrize(("key", "arrow", "payload"), said())
def test_an_example_is_read_and_written_again_as_it_stands(key: str, arrow: str, payload: str) -> None:
    kind = KINDS[arrow if arrow != "=>" else key.removeprefix("sx/1/r1/")]
    assert encode(msgspec.json.decode(payload, type=kind)).decode() == payload


def test_the_examples_are_on_the_keys_that_the_code_uses() -> None:
    keys = KeyExpressions("r1")
    used = {key.partition("?")[0] for key, _, _ in said()}
    assert used == {
        keys.info, keys.state, keys.pose, keys.event, keys.command("start"), keys.command("pause"),
        *(keys.mission("office", step) for step in ("begin", "chunk/0", "commit")),
    }  # fmt: skip


def test_every_report_is_listed_with_its_fields() -> None:
    for kind in (StateReport, PoseReport):
        fields = " ".join(json.loads(encode(kind.__struct_fields__)))
        assert f"| `{kind.__name__}` | `{fields}`" in TEXT

"""Folders of a site's variants, which outlive the server; the next one shows the finished ones again."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic

FILE = "variant.json"


class KeptVariant(msgspec.Struct, frozen=True, kw_only=True):
    """A finished variant as a file: what pages show of it."""

    number: int
    shown: dict[str, Any]


class KeptVariants:
    """Folders of variants by number, in one place."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def folder(self, number: int) -> Path:
        """Return the folder of a variant."""
        return self._place / str(number)

    def keep(self, number: int, shown: dict[str, Any]) -> None:
        """Note a finished variant for the next server; on a full disk it is known to this one alone."""
        with suppress(OSError, InputError):
            content = msgspec.json.encode(KeptVariant(number=number, shown=shown))
            write_atomic(self.folder(number) / FILE, content)

    def finished(self) -> list[KeptVariant]:
        """Return the finished variants of an earlier server, by number; folders of all others are removed."""
        found = []
        for folder in sorted(self._place.iterdir()):
            kept = None
            with suppress(OSError, msgspec.DecodeError):
                kept = decoded((folder / FILE).read_bytes(), KeptVariant)
            if kept is not None and folder.name == str(kept.number):
                found.append(kept)
            else:
                shutil.rmtree(folder, ignore_errors=True)
        return sorted(found, key=lambda one: one.number)

    def remove(self, number: int) -> None:
        """Remove a variant's folder."""
        shutil.rmtree(self.folder(number), ignore_errors=True)


@contextmanager
def kept_variants(place: Path) -> Iterator[KeptVariants]:
    """Yield the variants of a place; of a temporary one if another server has it, or if it cannot be made."""
    with ExitStack() as opened:
        if not _locked(place, opened):
            place = Path(
                opened.enter_context(TemporaryDirectory(prefix="stopgo-site-", ignore_cleanup_errors=True))
            )
        yield KeptVariants(place)


def _locked(place: Path, opened: ExitStack) -> bool:
    """Lock the place until `opened` is closed or this process ends; false if that is impossible."""
    try:
        import fcntl

        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        lock = opened.enter_context(place.with_suffix(".lock").open("ab"))
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ModuleNotFoundError, OSError):
        return False
    return True

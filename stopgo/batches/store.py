"""Store of finished plans by what they depend on; several processes and machines may share one folder.

    STORE/surveys/KEY.json          storeys of a model
    STORE/readings/KEY.json         hashes of a floor's parts
    STORE/results/KK/KEY/           files of a plan; result.json has the size and hash of each
    STORE/claims/KEY.json           a plan that is being made, and by whom
    STORE/unfinished/               folders that are being filled

A result appears by one rename and is never changed, so a result that exists is whole. It is verified all the
same whenever it is used. A claim is alive as long as its counter goes on: a waiting process measures that by
its own clock, so the clocks of machines do not matter.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.given_file import file_digest

RESULT = "result.json"
BEAT_S = 2.0
"""Interval at which the owner of a claim counts on."""
SILENCE_S = 60.0
"""A claim whose counter stood still for so long has no owner any more."""
WAIT_S = 0.2
PATIENCE_S = 180.0
"""Longest wait for a folder on a network that is away."""
UNFINISHED_S = 24 * 3600.0
"""Age from which a folder in `unfinished` is nobody's any more."""


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """A finished plan in the store."""

    exit_code: int
    text: str
    """Report for a person."""
    reports: list[dict[str, Any]]
    """Report of each part, as `stopgo plan --json` prints it."""
    parts: dict[str, str]
    """Hashes of the floor's parts."""
    settings: dict[str, Any]
    computed_by: str
    floor: str
    """Name of the file that it was planned from …"""
    floor_digest: str
    """… and sha256 of its bytes."""
    planned: str
    """Day, as YYYY-MM-DD."""
    seconds: float
    files: dict[str, tuple[int, str]]
    """Size and sha256 of each file."""


class Claim(msgspec.Struct, frozen=True):
    """Owner of a plan that is being made."""

    token: str
    host: str
    process: int
    count: int = 0


@dataclass(frozen=True)
class ResultStore:
    """A folder with finished plans."""

    folder: Path

    @classmethod
    def at(cls, folder: Path) -> ResultStore:
        """Return the store in a folder, which is made if it does not exist.

        Raises
        ------
        InputError
            When the folder cannot be made or written.
        """
        try:
            for name in ("surveys", "readings", "results", "claims", "unfinished"):
                (folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{folder}: the store cannot be made ({error.strerror}); name another with --store"
            ) from None
        return cls(folder)

    def is_there(self) -> bool:
        """True if the folder can be seen."""
        return (self.folder / "results").is_dir()

    def wait_until_there(self, patience_s: float = PATIENCE_S) -> bool:
        """Wait for a folder on a network that is away for a while; False if it stays away."""
        deadline = time.monotonic() + patience_s
        while not self.is_there():
            if time.monotonic() > deadline:
                return False
            time.sleep(WAIT_S)
        return True

    # Small facts.

    def read_fact(self, kind: str, key: str) -> Any | None:
        """Return what was stored of a survey or reading; None if nothing usable is there."""
        path = self.folder / kind / f"{key}.json"
        try:
            fact = msgspec.json.decode(path.read_bytes())
            os.utime(path)
        except (OSError, msgspec.DecodeError):
            return None
        return fact

    def write_fact(self, kind: str, key: str, fact: object) -> None:
        """Store what a survey or reading found."""
        write_atomic(self.folder / kind / f"{key}.json", msgspec.json.encode(fact))

    # Results.

    def result_folder(self, key: str) -> Path:
        """Return the folder of a result, whether it exists or not."""
        return self.folder / "results" / key[:2] / key

    def find(self, key: str) -> Result | None:
        """Return a result whose files are all whole; one that is damaged is removed."""
        folder = self.result_folder(key)
        try:
            result = decoded((folder / RESULT).read_bytes(), Result)
        except OSError:
            return None
        except msgspec.DecodeError:
            self._discard(folder)
            return None
        if not all(_is_whole(folder / name, *facts) for name, facts in result.files.items()):
            self._discard(folder)
            return None
        with contextlib.suppress(OSError):  # a read-only store still serves
            os.utime(folder / RESULT)
        return result

    @contextmanager
    def filling(self) -> Iterator[Path]:
        """Yield an empty folder for a plan's files; it is removed at the end unless it was published."""
        folder = self.folder / "unfinished" / secrets.token_hex(8)
        folder.mkdir()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def publish(self, key: str, filled: Path, result: Result) -> Result:
        """Make a filled folder the result of a key, and return it with the size and hash of each file.

        Where another process published the same first, its result is returned.
        """
        files = {path.name: (path.stat().st_size, file_digest(path)) for path in sorted(filled.iterdir())}
        result = msgspec.structs.replace(result, files=files)
        write_atomic(filled / RESULT, msgspec.json.encode(result))
        target = self.result_folder(key)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.rename(filled, target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            return self.find(key) or result
        return result

    def _discard(self, folder: Path) -> None:
        """Remove a folder so that nobody sees it half removed."""
        gone = self.folder / "unfinished" / secrets.token_hex(8)
        with contextlib.suppress(OSError):
            os.rename(folder, gone)
            shutil.rmtree(gone, ignore_errors=True)

    # Claims.

    @contextmanager
    def claimed(self, key: str) -> Iterator[None]:
        """Hold the claim on a key during the block; wait for another owner, or until it is gone."""
        path = self.folder / "claims" / f"{key}.json"
        claim = Claim(secrets.token_hex(8), socket.gethostname(), os.getpid())
        _take(path, claim)
        ended = threading.Event()
        beat = threading.Thread(target=_count_on, args=(path, claim, ended), daemon=True)
        beat.start()
        try:
            yield
        finally:
            ended.set()
            beat.join()
            if _claim_in(path, default=claim).token == claim.token:
                path.unlink(missing_ok=True)

    # Upkeep.

    def collect_garbage(
        self, *, most_bytes: int | None = None, oldest_s: float | None = None
    ) -> tuple[int, int]:
        """Remove results by age of last use, and the longest unused ones above a size; counts and bytes."""
        now = time.time()
        self._remove_abandoned(now - UNFINISHED_S)
        found = sorted(self._results())
        total = sum(size for _, size, _ in found)
        removed = freed = 0
        for used, size, folder in found:
            too_old = oldest_s is not None and now - used > oldest_s
            if too_old or (most_bytes is not None and total - freed > most_bytes):
                self._discard(folder)
                removed, freed = removed + 1, freed + size
        for kind in ("surveys", "readings"):
            for path in (self.folder / kind).iterdir():
                if oldest_s is not None and now - path.stat().st_mtime > oldest_s:
                    path.unlink(missing_ok=True)
        return removed, freed

    def _remove_abandoned(self, before: float) -> None:
        """Remove what processes left behind that ended in the middle, before a time."""
        for path in (*(self.folder / "unfinished").iterdir(), *(self.folder / "claims").iterdir()):
            with contextlib.suppress(OSError):  # another process removed it
                if path.stat().st_mtime > before:
                    continue
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink()

    def _results(self) -> Iterator[tuple[float, int, Path]]:
        """Last use, size in bytes and folder of each result."""
        for manifest in (self.folder / "results").glob(f"*/*/{RESULT}"):
            with contextlib.suppress(OSError):  # another process removed it
                size = sum(path.stat().st_size for path in manifest.parent.iterdir())
                yield manifest.stat().st_mtime, size, manifest.parent


def _is_whole(path: Path, size: int, sha256: str) -> bool:
    try:
        return path.stat().st_size == size and file_digest(path) == sha256
    except OSError:
        return False


def _take(path: Path, claim: Claim) -> None:
    """Write the claim as soon as no living process has one."""
    seen, since = None, time.monotonic()
    while not _create(path, claim):
        other = _claim_in(path)
        if other != seen:
            seen, since = other, time.monotonic()
        elif other is not None and (_is_dead(other) or time.monotonic() - since > SILENCE_S):
            _remove_stale(path, other)
            continue
        time.sleep(WAIT_S)


def _create(path: Path, claim: Claim) -> bool:
    """Create the claim whole, or return False if one exists."""
    written = path.with_name(f"{path.name}.{claim.token}")
    written.write_bytes(msgspec.json.encode(claim))
    try:
        os.link(written, path)
    except FileExistsError:
        return False
    finally:
        written.unlink(missing_ok=True)
    return True


def _claim_in(path: Path, default: Claim | None = None) -> Any:
    try:
        return decoded(path.read_bytes(), Claim)
    except (OSError, msgspec.DecodeError):
        return default or Claim("", "", 0)


def _is_dead(claim: Claim) -> bool:
    """True if the owner ran on this machine and is no more."""
    if claim.host != socket.gethostname() or os.name != "posix":
        return False
    try:
        os.kill(claim.process, 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False


def _remove_stale(path: Path, claim: Claim) -> None:
    """Remove the claim of an owner that is gone, unless somebody else has claimed it by now."""
    aside = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    try:
        os.rename(path, aside)
    except OSError:
        return
    if _claim_in(aside).token != claim.token:  # a new owner's: give it back
        with contextlib.suppress(FileExistsError):
            os.link(aside, path)
    aside.unlink(missing_ok=True)


def _count_on(path: Path, claim: Claim, ended: threading.Event) -> None:
    """Change the claim's file while its owner lives."""
    count = 0
    while not ended.wait(BEAT_S):
        count += 1
        written = path.with_name(f"{path.name}.{claim.token}")
        with contextlib.suppress(OSError):  # the folder may be away for a while
            if _claim_in(path).token != claim.token:
                return
            written.write_bytes(msgspec.json.encode(msgspec.structs.replace(claim, count=count)))
            os.replace(written, path)

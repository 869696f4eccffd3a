"""Atomic writing of files: after an error, a full disk, a crash or Ctrl-C no partial file remains."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from tempfile import NamedTemporaryFile

from stopgo.mission.errors import InputError


def write_atomic(path: Path | str, data: bytes) -> None:
    """Write `data` under a temporary name in the same folder, sync it to disk, then rename it.

    Raises
    ------
    InputError
        As `replacing` does.
    """
    with replacing(path) as (temporary,):
        temporary.write_bytes(data)


def write_checked(path: Path | str, data: bytes) -> None:
    """Write as `write_atomic`, and verify that the file holds the data."""
    write_atomic(path, data)
    if Path(path).read_bytes() != data:
        raise InputError(f"{path}: does not hold what was written; is another program writing to it?")


@contextlib.contextmanager
def replacing(*paths: Path | str) -> Iterator[list[Path]]:
    """Yield empty files next to `paths` for the block to fill; they replace `paths` when it ends well.

    All are synced to disk before the first is renamed, and they are renamed in the order given. Symbolic
    links are followed; the old files stay until the rename, and for good if the block raises.

    Raises
    ------
    InputError
        When a folder is missing or cannot be written, or the disk is full; `paths` are then untouched.
    """
    with replacement() as made:
        with made.filled(*paths) as temporaries:
            yield temporaries
        made.replace()


@contextlib.contextmanager
def replacement() -> Iterator[Replacement]:
    """Yield files that are filled one after another and appear together; what did not appear is removed."""
    made = Replacement()
    try:
        yield made
    finally:
        made.discard()


class Replacement:
    """Temporary files next to others, which `replace` puts in their places together."""

    def __init__(self) -> None:
        self._named: list[Path | str] = []
        self._temporaries: list[Path] = []
        self._targets: list[Path] = []

    @contextlib.contextmanager
    def filled(self, *paths: Path | str) -> Iterator[list[Path]]:
        """Yield empty files next to `paths` for the block to fill; errors are those of `replacing`."""
        targets = [_target(path) for path in paths]
        temporaries = [target.parent / f".stopgo-{secrets.token_hex(6)}.tmp" for target in targets]
        self._named += paths
        self._targets += targets
        self._temporaries += temporaries
        with self._refusing():
            for temporary in temporaries:
                _create(temporary)
            yield temporaries

    def replace(self) -> None:
        """Sync all files to disk, then rename them in the order in which they were filled."""
        with self._refusing():
            for temporary in self._temporaries:
                _sync(temporary)
            for temporary, target in zip(self._temporaries, self._targets, strict=True):
                os.replace(temporary, target)
            for folder in {target.parent for target in self._targets}:
                _sync_folder(folder)

    def discard(self) -> None:
        """Remove the files that did not replace others."""
        for temporary in self._temporaries:
            with contextlib.suppress(OSError):  # gone after the rename, and nothing to do if it cannot go
                temporary.unlink(missing_ok=True)

    @contextlib.contextmanager
    def _refusing(self) -> Iterator[None]:
        """Raise what the disk refuses as an InputError with the file, or with the folder of several."""
        try:
            yield
        except OSError as error:
            folder = self._targets[0].parent
            raise InputError(
                f"{self._named[0] if len(self._named) == 1 else folder}: cannot be written "
                f"({error.strerror}); "
                f"check that the folder {folder} is writable and has space, or choose another"
            ) from None


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process is in this block for the same folder.

    Systems and disks that cannot lock a folder are not waited for.
    """
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows has no such locks
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # a disk over the network may have none
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def must_be_writable(path: Path) -> None:
    """Refuse a path where no file can be created, before any work is done for it.

    Raises
    ------
    InputError
        Naming the path and the problem.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file in it")
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is not a file (a device or similar); give another name")
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError(f"{path}: {path.parent} is a file, not a folder; give another path")
    if not path.parent.is_dir():
        raise InputError(f"{path}: folder {path.parent} does not exist; create it first")
    _try_beside(path)


def must_not_replace(out: Path | None, *inputs: Path | None) -> None:
    """Refuse to overwrite an input file.

    Raises
    ------
    InputError
        Naming the file.
    """
    for path in inputs:
        if out is not None and path is not None and out.exists() and path.exists() and out.samefile(path):
            raise InputError(f"{out}: is also an input and would be overwritten; choose another file")


def _try_beside(path: Path) -> None:
    """Create a file next to `path` and remove it: permissions alone do not prove that it is possible."""
    try:
        with NamedTemporaryFile(dir=path.parent, prefix=f"{path.stem}.partial-", suffix=path.suffix):
            pass
    except OSError as error:
        raise InputError(
            f"{path}: no file can be created in {path.parent} ({error.strerror}); give another path"
        ) from None


def _target(path: Path | str) -> Path:
    if str(path) == "-":
        raise InputError("-: results are written to files, checked and whole; give a file's name")
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise InputError(f"{path}: folder {target.parent} does not exist; create it first")
    if target.exists() and not target.is_file():
        raise InputError(f"{path}: is not a regular file; choose another name")
    return target


def _create(path: Path) -> None:
    # O_EXCL: never write through something that another process put there.
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDWR)  # some systems sync only what may be written
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself survive a power loss; only POSIX can open a folder."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

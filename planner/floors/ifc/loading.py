"""The model in a file: read in a process of its own, and kept, so that a second plan starts at once."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path

from msgspec.structs import replace

from stopgo.mission.errors import InputError, MissingExtra
from stopgo.mission.files.atomic import write_atomic
from stopgo.planner.floors.ifc.model import Model, unpacked
from stopgo.planner.floors.ifc.model import packed as pack
from stopgo.planner.floors.reader import FloorFile

FORM = 9
"""Raised whenever what is kept of a model, or how it is read, changes."""
MOST_KEPT = 2 * 1024**3
"""Bytes of models that are kept; the ones longest unused go first."""
MOST_CRASHES = 20
"""So often the geometry kernel may crash on one model before it is given up."""
LARGEST_ZIPPED = 1024**3
"""Bytes of an unzipped model at most."""
MOST_PACKED = 100
"""A model packs to no less than this fraction of its size (1/100); more is a zip bomb …"""
NO_BOMB = 50 * 1024**2
"""… unless it is no larger than this, bytes."""
PIECE = 1024**2
"""Bytes that are unpacked at a time."""
READING = "import sys; from stopgo.planner.floors.ifc.extract import main; sys.exit(main(sys.argv[1:]))"
"""The other process."""
SCHEMAS = ("IFC2X3", "IFC4", "IFC4X3")
MARK = b"ISO-10303-21"


def load(file: FloorFile) -> Model:
    """The model in a file.

    Raises
    ------
    InputError
        When the file is no model that can be read; MissingExtra without ifcopenshell.
    """
    kept = _kept_at(file)
    model = _kept(kept)
    if model is None:
        data = _unzipped(file)
        _check(data, file.path)
        packed = _extracted(data, file.path)
        _keep(kept, packed)
        model = unpacked(packed)
    if not model.meshes:
        raise InputError(
            f"{file.path}: holds no wall, slab, space or other element with a shape; export the building"
        )
    return model


def cache_folder() -> Path:
    """Folder of loaded models, below the user's XDG_CACHE_HOME."""
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(home).expanduser() / "stopgo" / "models"


def _kept_at(file: FloorFile) -> Path:
    try:
        kernel = version("ifcopenshell")
    except ModuleNotFoundError:
        raise MissingExtra(
            'ifcopenshell is not installed; install it with: pip install "stopgo[bim]"'
        ) from None
    return cache_folder() / f"{file.digest}-{FORM}-{kernel}.npz"


def _kept(path: Path) -> Model | None:
    """The model that was kept, if it is there and whole."""
    try:
        model = unpacked(path.read_bytes())
        os.utime(path)
    except (OSError, ValueError):
        return None
    return model


def _keep(path: Path, packed: bytes) -> None:
    """Keep a model, as far as the user's folder takes it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, packed)
        _forget_oldest(path.parent)
    except (OSError, InputError):
        return  # the next plan reads the model again


def _forget_oldest(folder: Path) -> None:
    there = sorted(folder.glob("*.npz"), key=lambda path: path.stat().st_mtime, reverse=True)
    size = 0
    for path in there:
        size += path.stat().st_size
        if size > MOST_KEPT:
            path.unlink(missing_ok=True)


def _unzipped(file: FloorFile) -> bytes:
    if not file.data.startswith(b"PK"):
        return file.data
    try:
        with zipfile.ZipFile(io.BytesIO(file.data)) as archive:
            members = [item for item in archive.infolist() if item.filename.lower().endswith(".ifc")]
            if len(members) != 1:
                raise InputError(f"{file.path}: holds {len(members)} .ifc files; zip one model alone")
            _check_size(members[0].file_size, file)
            with archive.open(members[0]) as packed:
                # In pieces: read at once it is all unpacked, before its size is found to be another one.
                return b"".join(iter(partial(packed.read, PIECE), b""))
    except (zipfile.BadZipFile, OSError, EOFError, RuntimeError, ValueError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"{file.path}: cannot be unzipped ({said}); copy or export it again") from None


def _check_size(unpacked_size: int, file: FloorFile) -> None:
    """Refuse a model that is too large, or that is unpacked to fill the memory."""
    if unpacked_size > LARGEST_ZIPPED:
        raise InputError(f"{file.path}: unpacks to {unpacked_size} bytes; export one building")
    if unpacked_size > max(NO_BOMB, MOST_PACKED * len(file.data)):
        raise InputError(
            f"{file.path}: {len(file.data)} bytes unpack to {unpacked_size}, as no model does; unzip it first"
        )


def _check(data: bytes, path: Path) -> None:
    """Refuse what no kernel needs to be asked about: other schemas, and files that end early."""
    if MARK not in data[:1024]:
        raise InputError(f"{path}: is not an IFC file (it starts with {data[:16]!r}); export it as IFC")
    named = re.search(rb"FILE_SCHEMA\s*\(\s*\(\s*'([^']*)'", data[:65536], re.IGNORECASE)
    schema = named[1].decode("ascii", "replace").upper() if named else "none"
    known = schema in SCHEMAS or re.fullmatch(r"IFC4X3_ADD\d+|IFC4_ADD\d+(_TC\d+)?|IFC2X3_TC1", schema)
    if not known:
        raise InputError(f"{path}: schema {schema} is not read; export as one of {', '.join(SCHEMAS)}")
    if b"END-ISO-10303-21" not in data[-65536:]:
        raise InputError(f"{path}: is cut off after {len(data)} bytes (no END-ISO-10303-21); export it again")


def _extracted(data: bytes, path: Path) -> bytes:
    """The subprocess's result for a model; if it crashes, the model shape by shape without the bad shapes."""
    with tempfile.TemporaryDirectory(prefix="stopgo-model-") as folder:
        source, out = Path(folder) / "model.ifc", Path(folder) / "model.npz"
        source.write_bytes(data)
        code = _run(source, out, [])
        bad: list[str] = []
        while code < 0 and len(bad) < MOST_CRASHES:
            code = _run(source, out, ["--one-by-one", *bad])
            if code < 0:
                bad.append(_crashed_at(out, code, path))
        if code != 0:
            raise InputError(_why(out, code, path))
        return _with_crashed(out.read_bytes(), bad)


def _run(source: Path, out: Path, rest: Sequence[str]) -> int:
    """The other process's exit code; below 0 where a signal ended it."""
    stderr = None if sys.stderr.isatty() else subprocess.DEVNULL
    command = [sys.executable, "-c", READING, str(source), str(out), *rest]
    code = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=stderr, check=False
    )
    return code.returncode


def _crashed_at(out: Path, code: int, path: Path) -> str:
    """GlobalId of the product that was being made when the process died."""
    at = Path(f"{out}.at")
    if code == -signal.SIGKILL or not at.exists():
        raise InputError(_why(out, code, path))
    return at.read_text()


def _why(out: Path, code: int, path: Path) -> str:
    why = Path(f"{out}.why")
    if why.exists() and why.stat().st_size:
        return f"{path}: {why.read_text(encoding='utf-8')}"
    if code == -signal.SIGKILL:
        return f"{path}: reading it was killed, probably for lack of memory; export one building or storey"
    ended = f"signal {-code}" if code < 0 else f"exit code {code}"
    return f"{path}: the geometry kernel failed ({ended}); export the model again, or in another schema"


def _with_crashed(packed: bytes, bad: Sequence[str]) -> bytes:
    if not bad:
        return packed

    model = unpacked(packed)
    words = {text.split()[1]: text for text in model.described.failed}
    named = [words.get(guid, guid) for guid in bad]
    failed = tuple(text for guid, text in words.items() if guid not in bad)
    described = replace(model.described, crashed=tuple(named), failed=failed)
    return pack(Model(described, model.vertices, model.faces))

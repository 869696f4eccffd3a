"""Reader and writer of mission.json: strict reading, reproducible bytes in writing."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from stopgo.mission.document import SCHEMA, VERSION, Mission, canonical, digest_of, with_digest
from stopgo.mission.document.decoding import converted
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.given_file import bytes_of

_WIDEST = 2**53
"""Largest integer that readers with double-precision numbers keep exactly."""


def read(path: Path | str) -> Mission:
    """Return the mission in a file.

    Raises
    ------
    InputError
        When it cannot be read, or `parse` refuses it.
    """
    return parse(bytes_of(Path(path), "give a mission.json"), str(path))


def parse(data: bytes, name: str) -> Mission:
    """Return the mission in `data`; `name` is used in error messages. Verifies the digest, not the geometry.

    Raises
    ------
    InputError
        Naming the JSON path and the value: not JSON, an unknown, missing or repeated key, a wrong
        type, a number that is not finite, another schema or version, a digest that does not fit.
    """
    document = _parse_json(data, name)
    _check_schema(document, name)
    mission = _convert(document, name)
    _check_id(mission, name)
    _check_digest(document, mission, name)
    return mission


def encode(mission: Mission) -> bytes:
    """Return the mission with its digest set, as indented JSON; equal missions give equal bytes.

    Raises
    ------
    InputError
        When a number is not finite: JSON cannot hold it.
    """
    document = msgspec.to_builtins(with_digest(mission))
    _check_values(document, name="mission")
    return (_indented(document, "") + "\n").encode()


def write(mission: Mission, path: Path | str) -> None:
    """Write the mission, digest set, whole or not at all."""
    write_atomic(path, encode(mission))


def next_revision(path: Path | str, mission: Mission) -> int:
    """Return the revision with which `mission` replaces the file at `path`.

    Its own if there is no mission or another one. For a mission with the same id: the same revision if only
    the revision differs, else one more.
    """
    if not Path(path).is_file():  # a device has no end to read to; whoever writes there refuses it
        return mission.revision
    try:
        there = read(path)
    except InputError as error:
        raise InputError(f"{error}; move it away or choose another folder to plan into") from None
    if there.id != mission.id:
        return mission.revision
    same = digest_of(msgspec.structs.replace(mission, revision=there.revision)) == there.digest
    return there.revision if same else there.revision + 1


class _Repeated:
    """Marks the value of a key that an object has twice."""


def _parse_json(data: bytes, name: str) -> dict[str, Any]:
    try:
        document = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_object)
        _check_values(document, name)
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: not UTF-8 text (byte {error.start}); give a mission.json") from None
    except RecursionError:
        raise InputError(f"{name}: nested too deeply; give a mission.json") from None
    except ValueError as error:  # not JSON, or an integer with thousands of digits
        raise InputError(f"{name}: not JSON, or cut off ({error}); give a mission.json") from None
    if not isinstance(document, dict):
        raise InputError(f"{name}: $ is {_shown(document)}, not an object; give a mission.json")
    return document


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in pairs:
        values[key] = _Repeated() if key in values else value
    return values


def _check_values(document: object, name: str) -> None:
    for path, value in _leaves(document, "$"):
        if isinstance(value, _Repeated):
            raise InputError(f"{name}: {path} occurs more than once; keep one")
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{name}: {path} is {value}; it must be a finite number")
        if isinstance(value, int) and abs(value) > _WIDEST:
            raise InputError(f"{name}: {path} is beyond ±2^53; no number in a mission is so large")
        if isinstance(value, str) and not _is_text(value):
            raise InputError(f"{name}: {path} holds half a surrogate pair, which is not text")


def _leaves(value: object, path: str) -> Iterator[tuple[str, object]]:
    if isinstance(value, dict):
        for key, item in value.items():
            if not _is_text(key):
                yield path, key
            yield from _leaves(item, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from _leaves(item, f"{path}[{index}]")
    else:
        yield path, value


def _is_text(value: str) -> bool:
    return not any("\ud800" <= character <= "\udfff" for character in value)


_ID = re.compile(r"[0-9A-Za-z_-]{1,64}")
"""Form of an id, because key expressions and file names contain it."""


def _check_id(mission: Mission, name: str) -> None:
    if not _ID.fullmatch(mission.id):
        raise InputError(
            f"{name}: $.id is {_shown(mission.id)}: must be 1 to 64 letters, digits, hyphens or underscores"
        )


def _check_schema(document: dict[str, Any], name: str) -> None:
    schema, version = document.get("schema"), document.get("version")
    if schema != SCHEMA:
        raise InputError(f"{name}: $.schema is {_shown(schema)}, not {SCHEMA!r}; give a mission.json")
    if version != VERSION or isinstance(version, bool):
        raise InputError(
            f"{name}: $.version is {_shown(version)}; this stopgo reads version {VERSION}: "
            "plan again, or use the stopgo that wrote it"
        )


def _convert(document: dict[str, Any], name: str) -> Mission:
    try:
        return converted(document, Mission)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at ")
        path = place.strip("`") or "$"
        raise InputError(f"{name}: {path} is {_shown(_at(document, path))}: {reason}") from None


def _check_digest(document: dict[str, Any], mission: Mission, name: str) -> None:
    """Verify the digest of the document as it is, so that it stays valid with parameters of later versions;
    or, if another program wrote 4.0 as 4, of the mission read from it."""
    rest = {key: value for key, value in document.items() if key != "digest"}
    digest = hashlib.sha256(canonical(rest)).hexdigest()
    if mission.digest not in (digest, digest_of(mission)):
        raise InputError(
            f"{name}: $.digest is {_shown(mission.digest)} but the content gives {digest[:12]}…: "
            "it was changed after it was written; plan again or take the original"
        )


def _at(document: object, path: str) -> Any:
    """Return the value at a path as msgspec writes it: `$.stops[0].x`."""
    value: Any = document
    for key, index in re.findall(r"\.([^.\[\]]+)|\[(\d+)\]", path):
        value = value[key] if key else value[int(index)]
    return value


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:36]}…"


def _indented(value: object, indent: str) -> str:
    """Return JSON with one key or point a line: a polyline is read as its points."""
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{deeper}{_scalar(key)}: {_indented(item, deeper)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list | tuple) and any(isinstance(item, dict | list | tuple) for item in value):
        lines = [deeper + _indented(item, deeper) for item in value]
        return "[\n" + ",\n".join(lines) + f"\n{indent}]"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_scalar(item) for item in value) + "]"
    return _scalar(value)


def _scalar(value: object) -> str:
    """Encode as in the canonical form, so that numbers read the same in both."""
    return msgspec.json.encode(value).decode()

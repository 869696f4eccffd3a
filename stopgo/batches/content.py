"""Content of a floor as hashes: two files whose floors have the same content give the same plan."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.mission.files.given_file import file_digest
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings, recorded_values

LIBRARIES = ("numpy", "scipy", "shapely", "highspy", "networkx", "ezdxf", "ifcopenshell", "pyvrp")
"""Libraries whose version may change a plan."""
CODE = ("mission", "planner", "recordings")
"""Folders of stopgo that make a plan's files."""
TARGETS = "targets"
ContentParts = dict[str, str]


def floor_parts(floor: FloorPlan, bodies: Sequence[object]) -> ContentParts:
    """Return a hash for every part of a floor: its outline, each room, opening and element, the rest.

    The name of the file and the hash of its bytes are not among them. `targets` is a number, no hash.
    """
    seen: Counter[str] = Counter()
    parts: ContentParts = {"outline": digest(floor.outline)}
    for kind, items in (("room", floor.rooms), ("opening", floor.openings), ("element", floor.elements)):
        for item in items:
            name = f"{kind} {getattr(item, 'global_id', None) or item.id}"
            seen[name] += 1
            parts[name if seen[name] == 1 else f"{name} ({seen[name]})"] = digest(item)
    parts[TARGETS] = str(sum(item.target and item.to_scan for item in floor.elements))
    parts["bodies"] = digest(tuple(bodies))
    rest = (floor.name, floor.source.chosen, floor.level, floor.georeference, floor.findings, floor.status)
    if floor.solids is not None:
        parts["solids"] = digest((floor.solids.triangles, floor.solids.ceiling, floor.solids.source))
    parts["other content"] = digest((rest, floor.on_robots_map, floor.ceiling_m, floor.ignored))
    return parts


def plan_key(parts: ContentParts, settings: Settings, *, all_parts: bool, strict: bool) -> str:
    """Return the hash of everything that a plan and its exit code depend on."""
    return digest((parts, recorded_values(settings), all_parts, strict, computed_by()))


def survey_key(path: Path) -> str:
    """Return the hash of everything that the list of a model's storeys depends on."""
    return digest((file_digest(path), computed_by()))


def reading_key(path: Path, settings: Settings) -> str | None:
    """Return the hash of everything that the reading of a floor depends on.

    None for a file that names others, such as a robot's map: it is read each time.
    """
    from stopgo.planner.floors import options_of

    if path.suffix.lower() in (".yaml", ".yml"):
        return None
    schedule = file_digest(Path(settings.schedule)) if settings.schedule else ""
    return digest(
        (path.stem, file_digest(path), options_of(settings), settings.targets, schedule, computed_by())
    )


@cache
def computed_by() -> str:
    """Return the version of what computes: a hash of stopgo's own code, and the libraries' versions."""
    root = Path(__file__).parents[1]
    hashed = hashlib.sha256()
    for folder in CODE:
        for path in sorted((root / folder).resolve().rglob("*.py")):
            hashed.update(path.read_bytes())
    versions = (f"{name} {_version(name)}" for name in LIBRARIES)
    return f"{hashed.hexdigest()[:16]} with {', '.join(versions)}"


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"


def changes(before: Mapping[str, str], after: Mapping[str, str], *, most: int = 12) -> list[str]:
    """Return what differs between two sets of parts, one line each."""
    lines = [f"{name}: changed" for name in after if name in before and before[name] != after[name]]
    lines += [f"{name}: new" for name in after if name not in before]
    lines += [f"{name}: removed" for name in before if name not in after]
    return lines if len(lines) <= most else [*lines[:most], f"and {len(lines) - most} more"]


def digest(value: object) -> str:
    """Return the hash of a frozen value: dataclasses by their fields, arrays by their bytes."""
    hashed = hashlib.sha256()
    for piece in _pieces(value):
        hashed.update(piece)
    return hashed.hexdigest()[:32]


def _pieces(value: Any) -> Iterable[bytes]:
    """Bytes of a value, each with its type in front, so that no two values run into one another."""
    if isinstance(value, np.ndarray):
        yield f"a{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, str):
        encoded = value.encode(errors="surrogatepass")
        yield f"t{len(encoded)}:".encode() + encoded
    elif hasattr(value, "wkb"):  # a geometry of shapely
        yield b"g" + value.wkb
    elif (inside := _inside(value)) is not None:
        yield f"s{type(value).__name__}{len(inside)}".encode()
        for item in inside:
            yield from _pieces(item)
    else:
        yield f"v{value!r};".encode()


def _inside(value: Any) -> Sequence[Any] | None:
    """The values that a value consists of; None if it is a number or the like."""
    if isinstance(value, Enum):
        return (value.value,)
    if isinstance(value, Path):
        return (value.name,)
    if isinstance(value, Mapping):
        return [part for key in sorted(value) for part in (key, value[key])]
    if isinstance(value, tuple | list | set | frozenset):
        return sorted(value) if isinstance(value, set | frozenset) else value
    if is_dataclass(value):
        return [getattr(value, field.name) for field in fields(value)]
    return None

"""Parts of a floor from strokes and words: its outline, rooms, openings and elements."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Element, Finding, IgnoredLine, Opening, Room
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.planner.floors.drawn import Drawn, drawn, outline_faces
from stopgo.planner.floors.elements import elements_of
from stopgo.planner.floors.joints import without_joints
from stopgo.planner.floors.lines_and_texts import Stroke, Word
from stopgo.planner.floors.openings import openings_of
from stopgo.planner.floors.rings import GAP, SNAP, Region, canonical_region, even_odd
from stopgo.planner.floors.rooms import rooms_of


@dataclass(frozen=True, eq=False)
class FloorParts:
    """Outline, rooms, openings and elements of a floor plan."""

    outline: tuple[Polygon, ...]
    rooms: tuple[Room, ...]
    openings: tuple[Opening, ...]
    elements: tuple[Element, ...]
    ignored: tuple[IgnoredLine, ...]
    findings: tuple[Finding, ...]


def parts_of(
    strokes: Sequence[Stroke],
    words: Sequence[Word],
    *,
    source: Path,
    layers: Iterable[str],
    known: frozenset[str] = frozenset(),
    skipped: str = "",
) -> FloorParts:
    """Return the parts that strokes and words on the known layers draw.

    Raises
    ------
    InputError
        When nothing on layer FLOOR is closed; it names the `layers` that are present and what was `skipped`.
    """
    on = _drawn_by_role(strokes)
    outline, odd_outline = outline_of(on["floor"])
    if outline.is_empty:
        why = f"{_why_no_outline(on['floor'])}{skipped}; layers present: {_listed(layers)}"
        raise InputError(f"{source}: {why} (draw the outline there as a closed polyline)")
    rooms, odd_rooms = rooms_of(on["rooms"], _room_names(words), outline=outline)
    openings, odd_openings = openings_of(doors=on["doors"], passages=on["passages"])
    elements, left_out, odd_elements = elements_of(on, outline=outline, rooms=rooms)
    ignored = (*left_out, *(IgnoredLine(line.layer, line.points) for line in on["other"].open))
    odd_layers = [*_unknown_layers(on["other"], words, known), *_dropped(on)]
    findings = (*odd_outline, *odd_rooms, *odd_openings, *odd_elements, *odd_layers)
    return FloorParts(canonical_region(outline), rooms, openings, elements, ignored, findings)


def _drawn_by_role(strokes: Iterable[Stroke]) -> defaultdict[str, Drawn]:
    sorted_out: defaultdict[str, list[Stroke]] = defaultdict(list)
    for stroke in strokes:
        sorted_out[stroke.role].append(stroke)
    on: defaultdict[str, Drawn] = defaultdict(Drawn)
    for role, own in sorted_out.items():
        on[role] = drawn(own, gap=GAP if role in ("floor", "rooms") else SNAP)
    return on


def outline_of(floor: Drawn) -> tuple[Region, list[Finding]]:
    """Return the region on layer FLOOR: rings in rings are holes, touching parts are one."""
    faces, findings = outline_faces(floor.open, layer="FLOOR", merge=True)
    rings = (*floor.closed, *faces)
    findings += [anomaly.about("FLOOR") for ring in rings for anomaly in ring.anomalies]
    outline, joints = without_joints(even_odd([ring.region for ring in rings]))
    return outline, [*findings, *joints]


def _why_no_outline(floor: Drawn) -> str:
    if not floor.open:
        return "no closed outline on layer FLOOR"
    lines = f"{counted(len(floor.open), 'open line')} with gaps over {GAP * 100:g} cm"
    return f"no closed outline on layer FLOOR, only {lines}"


def _listed(layers: Iterable[str], *, most: int = 20) -> str:
    names = sorted(set(layers), key=str.casefold)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def _room_names(words: Iterable[Word]) -> list[Word]:
    return sorted((word for word in words if word.role == "rooms" and word.text and word.at), key=_word_key)


def _word_key(word: Word) -> tuple:
    return (word.at, word.text)


def _unknown_layers(other: Drawn, words: Iterable[Word], known: frozenset[str]) -> list[Finding]:
    closed = Counter(shape.layer for shape in other.closed)
    lines = Counter(line.layer for line in other.open)
    texts = Counter(word.layer for word in words if word.role == "other")
    return [
        Finding(
            "unknown_layer",
            f"layer {layer} is not one of a floor's: {closed[layer]} closed shapes are obstacles, "
            f"{lines[layer]} open lines and {texts[layer]} texts or dimensions are ignored "
            f"({layer_option(layer)} says what it is)",
        )
        for layer in sorted({*closed, *lines, *texts} - known)
    ]


def _dropped(on: Mapping[str, Drawn]) -> list[Finding]:
    return [
        Finding(anomaly.code, f"layer {role.upper()}: {anomaly.text}", at=anomaly.at)
        for role, drawn_on in on.items()
        if role != "other"
        for anomaly in drawn_on.dropped
    ]


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings sorted; repeated findings become one with its count."""
    said: dict[tuple, list[Finding]] = {}
    for finding in sorted(findings, key=_finding_key):
        said.setdefault((finding.code, finding.element, finding.message), []).append(finding)
    return tuple(
        same[0] if len(same) == 1 else replace(same[0], message=f"{same[0].message} ({len(same)} times)")
        for same in said.values()
    )


def _finding_key(finding: Finding) -> tuple:
    return (finding.code, finding.element or "", finding.at or (), finding.message)

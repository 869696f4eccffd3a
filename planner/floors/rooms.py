"""Rooms of a floor: each ring on ROOMS is a room, or a hole in the room around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.floor import Finding, Room
from stopgo.mission.geometry import IntArray
from stopgo.planner.floors.drawn import Anomaly, Closed, Drawn, hole_indices, outline_faces, place, region_key
from stopgo.planner.floors.lines_and_texts import Word
from stopgo.planner.floors.rings import Region, canonical_region, parents, polygons_of

_NOISE = 1e-4
"""Area in m² below which an overlap of two rooms is numerical noise."""
MANY = 50
"""Rooms that touch another, above which those with an overlap are found first."""
THIN_M = 1e-8
"""An overlap less wide than this is noise, along whatever boundary."""


@dataclass(frozen=True, eq=False)
class _Room:
    """A room before it has an id."""

    region: Region
    name: str
    global_id: str | None
    anomalies: tuple[Anomaly, ...]


def rooms_of(
    drawn: Drawn, words: Sequence[Word], *, outline: Region
) -> tuple[tuple[Room, ...], list[Finding]]:
    """Return the rooms, without overlaps, named by the texts in them.

    A ring within another is a hole of it if it has the same GlobalId, or is drawn against it without a text
    or GlobalId of its own; else it is a room within a room. Both are cut out of the outer one.
    """
    faces, findings = outline_faces(drawn.open, layer="ROOMS", merge=False)
    rings = sorted((*drawn.closed, *faces), key=lambda ring: region_key(ring.region))
    above = parents([ring.region for ring in rings])
    names, stray = _names(rings, above, words)
    named = {id(ring) for ring, texts in zip(rings, names, strict=True) if texts}
    holes = hole_indices(rings, above, lambda inner, outer: _is_hole(inner, outer, named=id(inner) in named))
    inner: dict[int | None, list[Region]] = {}
    for ring, parent in zip(rings, above, strict=True):
        inner.setdefault(parent, []).append(ring.region)
    rooms = [
        _Room(_hollowed(ring, inner.get(index, [])), _title(names[index]), ring.global_id, ring.anomalies)
        for index, ring in enumerate(rings)
        if index not in holes
    ]
    numbered, dropped = _numbered(_apart(_by_global_id(rooms)), outline=outline)
    return numbered, [*findings, *stray, *dropped]


def _names(
    rings: Sequence[Closed], above: Sequence[int | None], words: Sequence[Word]
) -> tuple[list[list[Word]], list[Finding]]:
    """The texts in each ring, each in the innermost one that is not a hole by its GlobalId."""
    names: list[list[Word]] = [[] for _ in rings]
    stray: list[Finding] = []
    for word, home in zip(words, _homes(words, rings, above), strict=True):
        if home is None:
            stray.append(
                Finding("text_outside_rooms", f"ROOMS: text '{word.text}' lies in no room", at=word.at[0])
            )
        else:
            names[home].append(word)
    return names, stray


def _homes(
    words: Sequence[Word], rings: Sequence[Closed], above: Sequence[int | None]
) -> Iterator[int | None]:
    """For each text the smallest ring round its first point that lies in one; None if none does."""
    by_size = sorted(range(len(rings)), key=lambda index: rings[index].region.area)
    by_size = [index for index in by_size if not _same_space(index, rings, above)]
    tree = shapely.STRtree([rings[index].region for index in by_size])
    for word in words:
        found = (tree.query(shapely.Point(at), predicate="intersects") for at in word.at)
        yield next((by_size[min(ranks)] for ranks in found if len(ranks)), None)


def _same_space(index: int, rings: Sequence[Closed], above: Sequence[int | None]) -> bool:
    parent = above[index]
    own = rings[index].global_id
    return parent is not None and own is not None and own == rings[parent].global_id


def _is_hole(inner: Closed, outer: Closed, *, named: bool) -> bool:
    if inner.global_id is not None:
        return inner.global_id == outer.global_id
    return not named and inner.clockwise != outer.clockwise


def _hollowed(ring: Closed, inner: Sequence[Region]) -> Region:
    return ring.region.difference(shapely.union_all(inner)) if inner else ring.region


def _title(words: Sequence[Word]) -> str:
    """Several texts of a room read from top to bottom, then left to right."""
    ordered = sorted(words, key=lambda word: (-word.at[0][1], word.at[0][0], word.text))
    return " ".join(dict.fromkeys(word.text for word in ordered))


def _by_global_id(rooms: Sequence[_Room]) -> list[_Room]:
    """Rings of one GlobalId that lie apart are one room."""
    merged: dict[str, _Room] = {}
    for index, room in enumerate(rooms):
        key = room.global_id or f"#{index}"
        if key in merged:
            region = merged[key].region.union(room.region)
            name = merged[key].name or room.name
            merged[key] = replace(
                merged[key], region=region, name=name, anomalies=(*merged[key].anomalies, *room.anomalies)
            )
        else:
            merged[key] = room
    return list(merged.values())


def _apart(rooms: Sequence[_Room]) -> list[_Room]:
    """Remove overlaps of rooms: the smaller room keeps the area."""
    ordered = sorted(rooms, key=lambda room: (room.region.area, region_key(room.region)))
    tree = shapely.STRtree([room.region for room in ordered])
    return [_without_smaller(index, ordered, tree) for index in range(len(ordered))]


def _without_smaller(index: int, ordered: Sequence[_Room], tree: shapely.STRtree) -> _Room:
    room = ordered[index]
    met = np.sort(tree.query(room.region, predicate="intersects"))
    for item in _overlapping(room.region, met[met < index], tree.geometries).tolist():
        shared = room.region.intersection(ordered[item].region)
        if shared.area > _NOISE:
            text = f"overlaps room '{ordered[item].name}' by {shared.area:.3g} m², which is left to that one"
            anomaly = Anomaly("rooms_overlap", text, _corner(shared))
            region = room.region.difference(ordered[item].region)
            room = replace(room, region=region, anomalies=(*room.anomalies, anomaly))
    return room


def _overlapping(region: Region, touching: IntArray, regions: NDArray[np.object_]) -> IntArray:
    """Those of the touching regions that may overlap this one by an area; of few, all.

    A room around very many touches each of them, and an intersection takes time as its number of vertices.
    """
    if len(touching) <= MANY:
        return touching
    shapely.prepare(region)
    inner = shapely.buffer(regions[touching], -THIN_M)
    return touching[shapely.intersects(region, inner)]


def _corner(region: Region) -> tuple[float, float]:
    return place(shapely.get_coordinates(region))


def _numbered(rooms: Sequence[_Room], *, outline: Region) -> tuple[tuple[Room, ...], list[Finding]]:
    numbered: list[Room] = []
    findings: list[Finding] = []
    shapely.prepare(outline)
    for room in sorted(rooms, key=lambda item: region_key(item.region)):
        if not polygons_of(room.region):
            at = None if room.region.is_empty else _corner(room.region)
            findings.append(Finding("no_area", f"room '{room.name}' has no area left; dropped", at=at))
            continue
        made = Room(f"room-{len(numbered) + 1:03d}", room.name, canonical_region(room.region), room.global_id)
        numbered.append(made)
        findings += [anomaly.about(made.id) for anomaly in (*room.anomalies, *_outside(room.region, outline))]
    return tuple(numbered), findings


def _outside(region: Region, outline: Region) -> tuple[Anomaly, ...]:
    if outline.covers(region):
        return ()
    off = region.area - region.intersection(outline).area
    if off <= region.area / 2:
        return ()
    text = f"{off:.3g} m² of its {region.area:.3g} m² lie outside the outline on FLOOR"
    return (Anomaly("room_off_floor", text, _corner(region)),)

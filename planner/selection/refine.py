"""Selection -> selection: adds candidates near the chosen stops, which may save a stop.

Candidates lie on a coarse pattern, and the best stop is seldom on it. A fine pattern everywhere would
take too long. So only positions around the chosen stops are added, and the selection runs again. The
visible targets are still those of the pattern's candidates, so that the required coverage is the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.geometry import FloatArray, IntArray, read_only
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, Selection, Visibility
from stopgo.planner.candidates import judged
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.room_grid import main_axes
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.selection import BoundOf, forget_large_cover, greedy_takes_at_most, select
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.visibility import visibility

STEPS = (-0.5, -0.25, 0.0, 0.25, 0.5)
"""Offsets of new candidates from a stop along both axes of its room, in spacings of the grid."""
MOST = 25
"""Most stops for which refinement is the default: beyond, it takes more than a second."""


def select_refined(seen: Visibility, *, bound_of: BoundOf = lower_bound) -> Selection:
    """The selection, with fewer stops where positions off the pattern save some.

    The bound of scans that register is that of `bound_of`.
    """
    settings = seen.settings
    if settings.coverage_rule == "paper" or settings.fov < 360:
        return select(seen)
    if settings.registers:
        return _select_joined(seen, bound_of)
    first = select(seen)
    nearby = _nearby_candidates(first) if _refines(settings, len(first.chosen)) else None
    if nearby is None:
        return first
    again = select(merged(seen, visibility(nearby)))
    return again if len(again.chosen) < len(first.chosen) else first


def _select_joined(seen: Visibility, bound_of: BoundOf) -> Selection:
    """The selection whose scans register, also from positions near the stops of one that need not."""
    asked = seen.settings.refine
    if not (greedy_takes_at_most(MOST, seen) if asked is None else asked):
        return select(seen, bound_of=bound_of)
    first = select(seen, joined=False)
    nearby = _nearby_candidates(first) if _refines(seen.settings, len(first.chosen)) else None
    if nearby is None:
        return select(seen, bound_of=bound_of)
    forget_large_cover(seen)
    return select(merged(seen, visibility(nearby)), bound_of=bound_of)


def _refines(settings: Settings, stops: int) -> bool:
    """True if more positions are offered: where required, else for few stops."""
    return stops <= MOST if settings.refine is None else settings.refine


def _nearby_candidates(selection: Selection) -> Candidates | None:
    """Allowed positions around the chosen stops that are not candidates yet; None if there are none."""
    candidates = selection.candidates
    free = np.setdiff1d(selection.chosen, np.union1d(candidates.must_rows, candidates.doorway_rows))
    chosen = candidates.kept[free]
    around = [_positions_around(candidates, int(index)) for index in chosen]
    positions = np.concatenate([np.empty((0, 2)), *around])
    room = np.repeat(candidates.room[chosen], len(STEPS) ** 2)
    found = judged(candidates.space, positions, room, part=candidates.chosen_part)
    known = {_rounded(point) for point in candidates.xy}
    new = {_rounded(found.xy[k]): k for k in found.kept[::-1] if _rounded(found.xy[k]) not in known}
    return extra_candidates(found, np.array([new[xy] for xy in sorted(new)])) if new else None


def _rounded(point: FloatArray) -> tuple[float, float]:
    """A position rounded to the micrometre, for comparison."""
    x, y = np.round(point, 6).tolist()
    return x, y


def _positions_around(candidates: Candidates, index: int) -> FloatArray:
    """Positions (n, 2) around a candidate, along the axes of its room."""
    space = candidates.space
    axes = main_axes(to_shape(space.rooms[candidates.room[index]].area, local_origin(space.floor)))
    along = np.array(STEPS) * space.settings.grid
    offsets = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    return candidates.xy[index] + offsets @ axes


PER_CANDIDATE = ("xy", "room", "reason", "part", "doorway", "must")
"""Arrays of `Candidates` with one entry per candidate; these candidates have no headings."""


def extra_candidates(found: Candidates, index: IntArray) -> Candidates:
    """Some of the candidates, marked as extra ones."""
    some: dict[str, Any] = {name: _frozen(getattr(found, name)[index]) for name in PER_CANDIDATE}
    return replace(found, **some, extra=_frozen(np.ones(len(index), dtype=np.bool_)))


def merged(seen: Visibility, more: Visibility) -> Visibility:
    """The visibility of both sets of candidates together."""
    one, other = seen.candidates, more.candidates
    both: dict[str, Any] = {name: _frozen(getattr(one, name), getattr(other, name)) for name in PER_CANDIDATE}
    before = one.extra if len(one.extra) else np.zeros(len(one.xy), dtype=np.bool_)
    extra = _frozen(before, other.extra)
    return replace(
        seen,
        candidates=replace(one, **both, extra=extra),
        pointer=_frozen(seen.pointer, seen.pointer[-1] + more.pointer[1:]),
        segment=_continued(seen, more, "segment"),
        first=_continued(seen, more, "first"),
        last=_continued(seen, more, "last"),
    )


def _continued(seen: Visibility, more: Visibility, name: str) -> NDArray[Any]:
    """An array of both; that of `seen` becomes a part of it, as long ranges have many millions of runs."""
    own = getattr(seen, name)
    both = _frozen(own, getattr(more, name))
    vars(seen)[name] = both[: len(own)]
    return both


def with_rows(seen: Visibility, rows: IntArray) -> Visibility:
    """The visibility of some of the reachable candidates (k,), ascending."""
    candidates = seen.candidates
    left_out = np.delete(candidates.kept, rows)
    index = np.setdiff1d(np.arange(len(candidates.xy)), left_out)
    some: dict[str, Any] = {name: _frozen(getattr(candidates, name)[index]) for name in PER_CANDIDATE}
    extra = candidates.extra if len(candidates.extra) else np.zeros(len(candidates.xy), dtype=np.bool_)
    counts = np.diff(seen.pointer)[rows]
    run = ranges(seen.pointer[rows], counts)
    return replace(
        seen,
        candidates=replace(candidates, **some, extra=_frozen(extra[index])),
        pointer=_frozen(np.concatenate([[0], np.cumsum(counts)])),
        segment=_frozen(seen.segment[run]),
        first=_frozen(seen.first[run]),
        last=_frozen(seen.last[run]),
    )


def _frozen(*arrays: NDArray[Any]) -> NDArray[Any]:
    """The arrays in one, read-only."""
    return read_only(np.concatenate(arrays, dtype=arrays[0].dtype))

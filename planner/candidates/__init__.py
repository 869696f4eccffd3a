"""Navigable space -> candidates: possible scan positions, with a reason for each that was dropped.

A strategy is a function `(space) -> (xy, room)`: positions (n, 2) in the drawing's metres and the index
of each one's room in `space.rooms`; or `(xy, room, reason)` where it drops some for reasons of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stopgo.mission.console.plugins import variant
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import (
    AT_EDGE,
    AVOIDED,
    DROP_REASONS,
    IN_HOLE,
    KEPT,
    OTHER_PART,
    OUTSIDE,
    TOO_CLOSE,
    UNREACHABLE,
    Candidates,
    NavigableSpace,
)
from stopgo.planner.candidates.fallback import best_point
from stopgo.planner.candidates.fixed_positions import doorways, required_stops
from stopgo.planner.candidates.grid import grid
from stopgo.planner.candidates.proposals import Proposals, in_order, joined
from stopgo.planner.candidates.triangulation import triangulation
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.geometry.side_work import in_halves
from stopgo.planner.space.reach import Reach, reach_of
from stopgo.planner.space.stop_feasibility import StopFeasibility

Strategy = Callable[[NavigableSpace], tuple[FloatArray, IntArray] | tuple[FloatArray, IntArray, IntArray]]
MANY = 10_000
"""Proposals from which two processes look at them."""
STRATEGIES: dict[str, Strategy] = {"grid": grid, "triangulation": triangulation}


def candidates(space: NavigableSpace, *, part: int | None = None) -> Candidates:
    """Candidates of the strategy named in the settings, for one connected part of the floor.

    `part` counts from the largest; None takes the part that holds the start, else the largest that
    has candidates and a room.
    """
    feasibility = StopFeasibility(space)
    found = _from_strategy(feasibility)
    proposed = [required_stops(feasibility), found, _for_empty_rooms(feasibility, found), doorways(space)]
    proposals = in_order(joined(proposed), feasibility.rooms)
    return _of_part(space, proposals, part)


def judged(space: NavigableSpace, xy: FloatArray, room: IntArray, *, part: int) -> Candidates:
    """Return given positions (n, 2) as candidates of one part, with a reason for each that was dropped."""
    reason = StopFeasibility(space).reasons(xy, room)
    return _of_part(space, Proposals.of(xy, room, reason), part)


def _from_strategy(feasibility: StopFeasibility) -> Proposals:
    xy, room, early = _generated(feasibility.space)

    def reasons(rows: Sequence[int]) -> list[int]:
        some = np.array(rows, dtype=np.int64)
        return feasibility.reasons(xy[some], room[some]).tolist()

    reason = np.array(in_halves(reasons, range(len(xy)), forked=len(xy) >= MANY), dtype=np.int64)
    return Proposals.of(xy, room, reason if early is None else np.where(early == KEPT, reason, early))


def _generated(space: NavigableSpace) -> tuple[FloatArray, IntArray, IntArray | None]:
    """Return the result of the strategy in the settings, checked: positions and their rooms."""
    method = variant("candidates", space.settings.candidates, STRATEGIES)
    result = method.several(method.called(space), "xy, room", most=3)
    xy = method.array(result[0], "xy", (None, 2))
    room = method.indices(result[1], "room", length=len(xy), below=len(space.rooms))
    if len(result) == 2:
        return xy, room, None
    return xy, room, method.indices(result[2], "reason", length=len(xy), below=len(DROP_REASONS))


def _for_empty_rooms(feasibility: StopFeasibility, found: Proposals) -> Proposals:
    """Propose the best point of every room for which the strategy found no candidate."""
    kept = set(found.room[found.reason == KEPT].tolist())
    empty = [k for k in range(len(feasibility.space.rooms)) if k not in kept]

    def best_points(rooms: Sequence[int]) -> list[FloatArray | None]:
        return [best_point(feasibility, k) for k in rooms]

    points = in_halves(best_points, empty, forked=len(found.xy) >= MANY)
    best = [(k, point) for k, point in zip(empty, points, strict=True) if point is not None]
    return Proposals.of([point for _, point in best], [k for k, _ in best])


def _of_part(space: NavigableSpace, proposals: Proposals, part: int | None) -> Candidates:
    xy, reason = proposals.xy, proposals.reason
    origin = local_origin(space.floor)
    reach = reach_of(space)
    at = np.full(len(xy), -1, dtype=np.int64)
    at[reason == KEPT] = reach.part_at(xy[reason == KEPT] - origin)
    reason = np.where((reason == KEPT) & (at < 0), UNREACHABLE, reason)
    extra = _for_overlap_only(space, proposals)
    own = np.where(extra, -1, at) if len(extra) else at
    if part is None and not np.any(own >= 0):
        raise NegativeResult(_no_candidate(space, reason))
    chosen = _chosen_part(space, proposals, reach, own) if part is None else part
    _check_required(space, proposals, at, chosen)
    reason = np.where((reason == KEPT) & (at != chosen), OTHER_PART, reason)
    return Candidates(
        space=space,
        xy=frozen(xy),
        room=frozen(proposals.room, np.int64),
        reason=frozen(reason, np.int64),
        part=frozen(at, np.int64),
        strategy=space.settings.candidates,
        chosen_part=chosen,
        part_area=reach.parts.areas,
        doorway=frozen(proposals.doorway, np.bool_),
        must=frozen(proposals.must, np.bool_),
        extra=extra,
    )


def _for_overlap_only(space: NavigableSpace, proposals: Proposals) -> BoolArray:
    """Doorways that the settings do not require: they may connect scans, and do not count as visibility."""
    settings = space.settings
    required = settings.door_scan or settings.door_candidates
    return frozen([] if required or not proposals.doorway.any() else proposals.doorway, np.bool_)


def _check_required(space: NavigableSpace, proposals: Proposals, at: IntArray, chosen: int) -> None:
    """Refuse required stops that the robot cannot reach."""
    for x, y in proposals.xy[proposals.must & (at != chosen)]:
        raise InputError(
            f"--require-stop {x:g},{y:g}: not reachable from the planned part; choose another position"
        )


def _chosen_part(space: NavigableSpace, proposals: Proposals, reach: Reach, at: IntArray) -> int:
    """Number of the start's part, else of the largest with candidates in rooms; unnamed floor comes last.

    A robot's map names no rooms, and only some pieces of it show passages: there the largest counts.
    """
    parts = set(at[at >= 0].tolist())
    if space.settings.start is not None:
        return _part_of_start(space, reach, parts)
    if space.floor.on_robots_map:
        return min(parts)
    in_room = np.array([space.rooms[k].room is not None for k in proposals.room])
    return min(set(at[(at >= 0) & in_room].tolist()) or parts)


def _part_of_start(space: NavigableSpace, reach: Reach, parts: set[int]) -> int:
    assert space.settings.start is not None
    x, y, _ = space.settings.start
    found = int(reach.part_at(np.array([[x, y]]) - local_origin(space.floor))[0])
    if found < 0:
        raise InputError(
            f"--start {x:g},{y:g}: the robot (radius {space.settings.radius:g} m) does not fit there; "
            "choose a position clear of walls and floor edges"
        )
    if found not in parts:
        raise NegativeResult(
            f"--start {x:g},{y:g}: no scan position is reachable from there; choose another start"
        )
    return found


def _no_candidate(space: NavigableSpace, reason: IntArray) -> str:
    """Message on why no candidate is left: most frequent reason first, and the options to change."""
    settings = space.settings
    keep, remedy = "the robot's radius", "--robot-radius"
    if settings.d_sec >= settings.radius:
        keep, remedy = f"the clearance of {settings.d_sec:g} m", "--clearance"
    causes = [
        (
            TOO_CLOSE,
            f"closer to an element than {keep}",
            remedy,
        ),
        (AT_EDGE, f"closer than {settings.edge:g} m to a floor edge", "--edge-clearance"),
        (AVOIDED, "in circles to avoid", "--avoid"),
        (UNREACHABLE, f"not reachable by a robot of radius {settings.radius:g} m", "--robot-radius"),
        (OUTSIDE, "outside the rooms", "--grid"),
        (IN_HOLE, "in holes", "--grid"),
    ]
    counted = sorted(
        ((int(np.sum(reason == code)), why, option) for code, why, option in causes), key=lambda c: -c[0]
    )
    reasons = ", ".join(f"{n} {why}" for n, why, _ in counted if n) or "none was generated"
    options = list(dict.fromkeys(option for n, _, option in counted if n)) or ["--grid"]
    return f"{space.floor.name}: no candidate is left ({reasons}); change {' or '.join(options[:2])}"


__all__ = ["STRATEGIES", "Strategy", "candidates", "judged"]

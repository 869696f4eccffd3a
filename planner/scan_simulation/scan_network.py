"""Registered pairs -> connected scans, their adjusted position errors, and the closing error of their loops.

All pairs together are adjusted by least squares, as survey software does. The error of a pair is a small
motion (vx, vy, ω) about the origin. The difference between the errors of its two scans should equal it,
weighted by the pair's normal matrix. In each component the first scan is without error, or the one in whose
frame the mission's predicted errors are.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import ScanNetwork
from stopgo.mission.stages.network import frame_of
from stopgo.planner.scan_simulation.registration import Registered, off

PairPoses = dict[int, list[tuple[int, FloatArray]]]
"""For each scan the scans registered with it, and their poses in its frame."""


def scan_network(mission: Mission, positions: FloatArray, pairs: Sequence[Registered]) -> ScanNetwork:
    """Return the network of a mission's scans from `positions` (n, 3), by the pairs that register."""
    names = [stop.id for stop in mission.stops]
    number = {name: index for index, name in enumerate(names)}
    good = [item for item in pairs if item.pair.registered]
    ends = [(number[item.pair.a], number[item.pair.b]) for item in good]
    links: PairPoses = {index: [] for index in range(len(names))}
    for (a, b), item in zip(ends, good, strict=True):
        links[a].append((b, item.there))
        links[b].append((a, frozen(np.linalg.inv(item.there))))
    frame = frame_of(mission)
    chains = _chains(links, [*([] if frame is None else [number[frame]]), *links])
    pieces: dict[int, list[str]] = {}
    for index, (first, _) in sorted(chains.items()):
        pieces.setdefault(first, []).append(names[index])
    gaps = [
        off(np.linalg.inv(chains[b][1]) @ chains[a][1] @ item.there)
        for (a, b), item in zip(ends, good, strict=True)
    ]
    around = len(good) > len(names) - len(pieces)
    errors = _adjusted(positions[:, :2], list(pieces), ends, good)
    return ScanNetwork(
        pairs=tuple(item.pair for item in pairs),
        pieces=tuple(sorted(map(tuple, pieces.values()), key=lambda piece: -len(piece))),
        closing_m=max(gap[0] for gap in gaps) if around else None,
        closing_deg=max(gap[1] for gap in gaps) if around else None,
        errors_m=dict(zip(names, np.hypot(*errors.T).tolist(), strict=True)),
        frame=frame,
    )


def _chains(links: PairPoses, firsts: Sequence[int]) -> dict[int, tuple[int, FloatArray]]:
    """For every scan the first scan of its component, and the pose in it along the fewest pairs."""
    found: dict[int, tuple[int, FloatArray]] = {}
    for first in firsts:
        if first in found:
            continue
        found[first] = (first, np.eye(4))
        waiting = deque([first])
        while waiting:
            here = waiting.popleft()
            for there, pose in links[here]:
                if there not in found:
                    found[there] = (first, found[here][1] @ pose)
                    waiting.append(there)
    return found


def _adjusted(
    xy: FloatArray, fixed: Sequence[int], ends: Sequence[tuple[int, int]], pairs: Sequence[Registered]
) -> FloatArray:
    """Position error of each scan (n, 2), metres, if all pairs are adjusted and some scans are fixed."""
    free = np.setdiff1d(np.arange(len(xy)), fixed)
    place = {int(k): 3 * row for row, k in enumerate(free)}
    normal, right = np.zeros((3 * len(free),) * 2), np.zeros(3 * len(free))
    for (a, b), pair in zip(ends, pairs, strict=True):
        about = _about_origin(xy[a])
        weight = about @ pair.information @ about.T
        error = weight @ _motion(xy[a], xy[b], pair.there)
        for i, sign in ((a, -1.0), (b, 1.0)):
            if i in place:
                right[place[i] : place[i] + 3] += sign * error
        for i, j, block in ((a, a, weight), (b, b, weight), (a, b, -weight), (b, a, -weight)):
            if i in place and j in place:
                normal[place[i] : place[i] + 3, place[j] : place[j] + 3] += block
    motion = np.zeros((len(xy), 3))
    motion[free] = np.linalg.solve(normal, right).reshape(-1, 3)
    return motion[:, :2] + motion[:, 2:] * np.column_stack([-xy[:, 1], xy[:, 0]])


def _about_origin(at: FloatArray) -> FloatArray:
    """Matrix (3, 3) that turns j = (nx, ny, p × n) about a point (2,) into that about the origin."""
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-at[1], at[0], 1.0]])


def _motion(a: FloatArray, b: FloatArray, there: FloatArray) -> FloatArray:
    """Small motion (vx, vy, ω) about the origin by which a pair's pose misplaces its second scan (3,)."""
    turn = float(np.arctan2(there[1, 0], there[0, 0]))
    away = a + there[:2, 3] - b
    return np.array([away[0] + turn * b[1], away[1] - turn * b[0], turn])

"""Registered pairs -> connected scans, their adjusted position errors, and the closing error of their loops.

All pairs together are adjusted by least squares, as survey software does. The error of a pair is a small
motion (vx, vy, ω) about the origin. The difference between the errors of its two scans should equal it,
weighted by the pair's normal matrix. One scan is without error: that in whose frame the mission's predicted
errors are. If control points hold this frame, the adjusted scans are moved together onto the control points
that they see; these are taken as exact.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import ScanNetwork
from stopgo.mission.stages.network import CONTROL_FRAME, frame_of
from stopgo.planner.overlap.control import SeenPoint
from stopgo.planner.overlap.network_error import normal_equations, sees_two_points, shift_at
from stopgo.planner.scan_simulation.registration import Registered, off

PairPoses = dict[int, list[tuple[int, FloatArray]]]
"""For each scan the scans registered with it, and their poses in its frame."""


def scan_network(
    mission: Mission, xy: FloatArray, pairs: Sequence[Registered], seen: Sequence[SeenPoint] = ()
) -> ScanNetwork:
    """Return the network of a mission's scans at `xy` (n, 2), by the pairs that register.

    `seen` are scans, and the control points that they see.
    """
    names = [stop.id for stop in mission.stops]
    number = {name: index for index, name in enumerate(names)}
    good = [item for item in pairs if item.pair.registered]
    ends = [(number[item.pair.a], number[item.pair.b]) for item in good]
    links: PairPoses = {index: [] for index in range(len(names))}
    for (a, b), item in zip(ends, good, strict=True):
        links[a].append((b, item.there))
        links[b].append((a, frozen(np.linalg.inv(item.there))))
    chains = _chains(links)
    pieces: dict[int, list[int]] = {}
    for index, (first, _) in sorted(chains.items()):
        pieces.setdefault(first, []).append(index)
    ordered = sorted(pieces.values(), key=lambda piece: -len(piece))
    gaps = [
        off(np.linalg.inv(chains[b][1]) @ chains[a][1] @ item.there)
        for (a, b), item in zip(ends, good, strict=True)
    ]
    around = len(good) > len(names) - len(pieces)
    frame, errors = _framed_errors(mission, ordered, _Adjustment(xy, ends, good, seen))
    return ScanNetwork(
        pairs=tuple(item.pair for item in pairs),
        pieces=tuple(tuple(names[index] for index in piece) for piece in ordered),
        closing_m=max(gap[0] for gap in gaps) if around else None,
        closing_deg=max(gap[1] for gap in gaps) if around else None,
        errors_m={names[k]: error for k, error in sorted(errors.items())},
        frame=frame,
    )


def _chains(links: PairPoses) -> dict[int, tuple[int, FloatArray]]:
    """For every scan the first scan of its component, and the pose in it along the fewest pairs."""
    found: dict[int, tuple[int, FloatArray]] = {}
    for first in links:
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


def _framed_errors(
    mission: Mission, pieces: Sequence[list[int]], adjustment: _Adjustment
) -> tuple[str, dict[int, float]]:
    """The frame of the errors, and the position errors of the scans that it holds, metres."""
    frame = frame_of(mission)
    held = [] if frame else [piece for piece in pieces if sees_two_points(piece, adjustment.seen)]
    if held:
        return CONTROL_FRAME, {
            k: error for piece in held for k, error in adjustment.on_control(piece).items()
        }
    names = [stop.id for stop in mission.stops]
    fixed = names.index(frame) if frame else pieces[0][0]
    return names[fixed], adjustment.by_scan(next(piece for piece in pieces if fixed in piece), fixed)


@dataclass(frozen=True, eq=False)
class _Adjustment:
    """Adjustment of the pairs of a network by least squares."""

    xy: FloatArray
    """Positions of the scans (n, 2)."""
    ends: Sequence[tuple[int, int]]
    pairs: Sequence[Registered]
    seen: Sequence[SeenPoint]

    def by_scan(self, piece: Sequence[int], fixed: int) -> dict[int, float]:
        """Position errors of a component's scans, metres, if one of them is fixed."""
        return self._errors(piece, self._motions([k for k in piece if k != fixed]))

    def on_control(self, piece: Sequence[int]) -> dict[int, float]:
        """Position errors of a component's scans, metres, moved together onto the control points they see."""
        motions = self._motions(piece[1:])
        seen = [(shift_at(point), motions[k]) for k, point in self.seen if k in piece]
        off_m = np.concatenate([shift @ motion for shift, motion in seen])
        together = np.linalg.lstsq(np.concatenate([shift for shift, _ in seen]), off_m, rcond=None)[0]
        return self._errors(piece, motions - together)

    def _errors(self, piece: Sequence[int], motions: FloatArray) -> dict[int, float]:
        return {k: float(np.hypot(*(shift_at(self.xy[k]) @ motions[k]))) for k in piece}

    def _motions(self, free: Sequence[int]) -> FloatArray:
        """Motions (n, 3) by which all pairs together misplace the free scans; zero for the others."""
        about = [_about_origin(self.xy[a]) for a, _ in self.ends]
        weights = [one @ pair.information @ one.T for one, pair in zip(about, self.pairs, strict=True)]
        right = np.zeros((len(self.xy), 3, 1))
        for (a, b), pair, weight in zip(self.ends, self.pairs, weights, strict=True):
            error = weight @ _motion(self.xy[a], self.xy[b], pair.there)
            right[a, :, 0] -= error
            right[b, :, 0] += error
        found, rows = np.zeros((len(self.xy), 3)), np.array(free, dtype=np.int64)
        equations = normal_equations(len(self.xy), rows, self.ends, weights)
        found[rows] = equations.solved(right[rows])[..., 0]
        return found


def _about_origin(at: FloatArray) -> FloatArray:
    """Matrix (3, 3) that turns j = (nx, ny, p × n) about a point (2,) into that about the origin."""
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-at[1], at[0], 1.0]])


def _motion(a: FloatArray, b: FloatArray, there: FloatArray) -> FloatArray:
    """Small motion (vx, vy, ω) about the origin by which a pair's pose misplaces its second scan (3,)."""
    turn = float(np.arctan2(there[1, 0], there[0, 0]))
    away = a + there[:2, 3] - b
    return np.array([away[0] + turn * b[1], away[1] - turn * b[0], turn])

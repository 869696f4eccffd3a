"""Registered pairs -> which scans hang together, and how far the chains of them drift and close."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import ScanNetwork
from stopgo.planner.scan_simulation.registration import Registered, off

PairPoses = dict[int, list[tuple[int, FloatArray]]]
"""Of each scan, the others it is registered with, and their poses in it."""


def joined(names: Sequence[str], places: FloatArray, pairs: Sequence[Registered]) -> ScanNetwork:
    """The network of the scans; chains are as short as can be, from the first scan of every piece."""
    number = {name: index for index, name in enumerate(names)}
    ways: PairPoses = {index: [] for index in range(len(names))}
    good = [(number[item.pair.a], number[item.pair.b], item.there) for item in pairs if item.pair.registered]
    for a, b, there in good:
        ways[a].append((b, there))
        ways[b].append((a, frozen(np.linalg.inv(there))))
    chains = _chains(ways)
    pieces: dict[int, list[str]] = {}
    adrift = [0.0]
    for index, (first, pose) in sorted(chains.items()):
        pieces.setdefault(first, []).append(names[index])
        adrift.append(float(np.linalg.norm(pose[:3, 3] - (places[index] - places[first]))))
    gaps = [off(np.linalg.inv(chains[b][1]) @ chains[a][1] @ there) for a, b, there in good]
    around = len(good) > len(names) - len(pieces)
    return ScanNetwork(
        pairs=tuple(item.pair for item in pairs),
        pieces=tuple(sorted(map(tuple, pieces.values()), key=lambda piece: -len(piece))),
        closing_m=max(gap[0] for gap in gaps) if around else None,
        closing_deg=max(gap[1] for gap in gaps) if around else None,
        adrift_m=max(adrift),
    )


def _chains(ways: PairPoses) -> dict[int, tuple[int, FloatArray]]:
    """Of every scan, the first of its piece and the pose in that one, along the fewest pairs."""
    found: dict[int, tuple[int, FloatArray]] = {}
    for first in ways:
        if first in found:
            continue
        found[first] = (first, np.eye(4))
        waiting = deque([first])
        while waiting:
            here = waiting.popleft()
            for there, pose in ways[here]:
                if there not in found:
                    found[there] = (first, found[here][1] @ pose)
                    waiting.append(there)
    return found

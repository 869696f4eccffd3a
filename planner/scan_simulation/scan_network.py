"""Registered pairs -> connected scans, with the drift and the closing error of their chains."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import ScanNetwork
from stopgo.planner.scan_simulation.registration import Registered, off

PairPoses = dict[int, list[tuple[int, FloatArray]]]
"""For each scan the scans registered with it, and their poses in its frame."""


def network_of(names: Sequence[str], positions: FloatArray, pairs: Sequence[Registered]) -> ScanNetwork:
    """The network of the scans, by shortest chains from the first scan of every component."""
    number = {name: index for index, name in enumerate(names)}
    links: PairPoses = {index: [] for index in range(len(names))}
    good = [(number[item.pair.a], number[item.pair.b], item.there) for item in pairs if item.pair.registered]
    for a, b, there in good:
        links[a].append((b, there))
        links[b].append((a, frozen(np.linalg.inv(there))))
    chains = _chains(links)
    pieces: dict[int, list[str]] = {}
    adrift = [0.0]
    for index, (first, pose) in sorted(chains.items()):
        pieces.setdefault(first, []).append(names[index])
        adrift.append(float(np.linalg.norm(pose[:3, 3] - (positions[index] - positions[first]))))
    gaps = [off(np.linalg.inv(chains[b][1]) @ chains[a][1] @ there) for a, b, there in good]
    around = len(good) > len(names) - len(pieces)
    return ScanNetwork(
        pairs=tuple(item.pair for item in pairs),
        pieces=tuple(sorted(map(tuple, pieces.values()), key=lambda piece: -len(piece))),
        closing_m=max(gap[0] for gap in gaps) if around else None,
        closing_deg=max(gap[1] for gap in gaps) if around else None,
        adrift_m=max(adrift),
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

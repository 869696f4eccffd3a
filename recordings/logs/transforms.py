"""Tree of frames from a log over time, and the pose of one frame in another.

Only the plane counts: x, y and the rotation about z of each transform are used.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray

Planar = tuple[FloatArray, FloatArray, FloatArray]
"""x, y, heading, each (n,)."""

ROOTS = ("map", "odom", "world")
BASES = ("base_footprint", "base_link", "base", "base_stabilized")


@dataclass
class Edge:
    """Transform over time, while it is read."""

    ns: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, ns: int, x: float, y: float, heading: float) -> None:
        self.ns.append(ns)
        self.values.extend((x, y, heading))

    def table(self) -> tuple[IntArray, FloatArray]:
        """Return times (n,) in order, and x, y, heading (n, 3)."""
        times, values = np.array(self.ns, np.int64), np.array(self.values).reshape(-1, 3)
        order = np.argsort(times, kind="stable")
        return times[order], values[order]


@dataclass
class TransformTree:
    """Frames by name, without a leading slash; grows while a log is read."""

    edges: dict[tuple[str, str], Edge] = field(default_factory=dict)
    """Edges by parent and child."""
    static: set[tuple[str, str]] = field(default_factory=set)

    def add(
        self, parent: str, child: str, ns: int, pose: tuple[float, float, float], *, static: bool
    ) -> None:
        """Add a transform."""
        key = (parent.lstrip("/"), child.lstrip("/"))
        self.edges.setdefault(key, Edge()).add(ns, *pose)
        if static:
            self.static.add(key)

    @property
    def frames(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for key in self.edges for name in key))

    def chain(self, root: str, leaf: str) -> list[tuple[str, str]]:
        """Return the edges from `root` down to `leaf`; empty if there is no such chain."""
        parents = {child: parent for parent, child in self.edges}
        edges_down: list[tuple[str, str]] = []
        while leaf != root and leaf in parents and len(edges_down) <= len(self.edges):
            edges_down.append((parents[leaf], leaf))
            leaf = parents[leaf]
        return edges_down[::-1] if leaf == root else []

    def robot_chain(self, frame: str | None) -> list[tuple[str, str]]:
        """Return the chain from the given frame, else the first of ROOTS, to the first of BASES below it."""
        names = self.frames
        roots = [frame.lstrip("/")] if frame is not None else [root for root in ROOTS if root in names]
        bases = [base for base in BASES if base in names]
        candidates = (self.chain(root, base) for root in roots for base in bases)
        return next(
            (edges_down for edges_down in candidates if any(edge not in self.static for edge in edges_down)),
            [],
        )

    def poses(self, edges_down: list[tuple[str, str]]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return times (n,), positions (n, 2) and headings (n,) of the chain's end in its beginning.

        The times are those of the most frequent edge, where all others are known; between their times, the
        others are interpolated, as in tf. An edge that the log gives once does not move.
        """
        tables = [self.edges[edge].table() for edge in edges_down]
        moving = [
            table
            for table, edge in zip(tables, edges_down, strict=True)
            if edge not in self.static and len(table[0]) > 1
        ] or [table for table, edge in zip(tables, edges_down, strict=True) if edge not in self.static]
        ns = max(moving, key=lambda table: len(table[0]))[0]
        begin, end = max(times[0] for times, _ in moving), min(times[-1] for times, _ in moving)
        ns = np.unique(ns[(ns >= begin) & (ns <= end)])
        x, y, heading = np.zeros(len(ns)), np.zeros(len(ns)), np.zeros(len(ns))
        for (times, values), edge in zip(tables, edges_down, strict=True):
            fixed = edge in self.static or len(times) == 1
            step = values[-1:].repeat(len(ns), 0) if fixed else at_times(times, values, ns)
            x, y, heading = composed((x, y, heading), (step[:, 0], step[:, 1], step[:, 2]))
        return ns, np.stack([x, y], axis=-1), heading

    def mounts(self, base: str) -> tuple[tuple[str, float, float, float], ...]:
        """Return frames that are fixed to the robot, with their poses on it."""
        candidates = []
        for name in self.frames:
            edges_down = self.chain(base, name)
            if edges_down and all(edge in self.static or len(self.edges[edge].ns) for edge in edges_down):
                pose: Planar = (np.zeros(1), np.zeros(1), np.zeros(1))
                for edge in edges_down:
                    last = self.edges[edge].table()[1][-1:]
                    pose = composed(pose, (last[:, 0], last[:, 1], last[:, 2]))
                candidates.append((name, float(pose[0][0]), float(pose[1][0]), float(pose[2][0])))
        return tuple(candidates)


def at_times(times: IntArray, values: FloatArray, ns: IntArray) -> FloatArray:
    """Return values (m, 3) of x, y, heading at times `ns`; headings change by the shorter rotation."""
    heading = np.unwrap(values[:, 2])
    seconds, wanted = (times - times[0]) / 1e9, (ns - times[0]) / 1e9
    columns = [np.interp(wanted, seconds, column) for column in (values[:, 0], values[:, 1], heading)]
    return np.stack(columns, axis=-1)


def composed(outer: Planar, inner: Planar) -> Planar:
    """Return `inner` in the frame that `outer` is given in."""
    cos, sin = np.cos(outer[2]), np.sin(outer[2])
    return (
        outer[0] + cos * inner[0] - sin * inner[1],
        outer[1] + sin * inner[0] + cos * inner[1],
        outer[2] + inner[2],
    )

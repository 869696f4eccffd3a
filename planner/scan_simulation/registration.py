"""Two scans -> registration error, starting from the error of a robot's pose, by a public library.

The scanner is level at a known height. So z, roll and pitch start without error, and the floor and ceiling
in both scans constrain them. Only surfaces that both scans show from the same side are matched, as survey
software does. Otherwise the two sides of a wall would be matched with each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, groupby
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import ScanPair, Simulation, within_tolerance
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.side_work import SideWork
from stopgo.planner.scan_simulation.near_kernel import ALONG_X, ALONG_Y, SHIFT, mark_near

VOXEL_M = 0.075
"""Clouds are thinned to a point per cube of this size."""
NEIGHBOURS = 15
TURNED_M = 0.5
"""Distance in metres that counts as much as one radian between two surface normals."""
PER_METRE = 5.0
"""Along 1 m, number of the cubes in which points near others are looked up; any gives the same."""
REPEATED = 16
"""Buckets repeated behind the last, so that cubes above one another lie in one row; few of these are near."""
SAME_M = 0.1
"""Largest distance between points of the same surface under the true poses."""
STAGES = ((0.15, 0.1), (0.1, 0.05))
"""Per stage, distances in metres: for shared surfaces, and for matched points.

A stage precedes them that reaches as far as the start may be off, and no farther: one of 0.3 m took points
of a column for those of another side. The last keeps points at the ends of a few shared surfaces from
pulling the pose: 13 mm became 1 mm.
"""
HEADING_M = 0.1
"""Distance by which one of the headings tried moves the farthest shared points from the next one.

Points that are so near to the other scan count as brought together.
"""
HEADING_FEW = 3
"""One of so many points of upright surfaces compares the headings."""
LEVEL_FEW = 10
"""One of so many points of level surfaces is kept: they hold height and tilt only."""
MANY = 8
"""Pairs of near scans from which a second process registers half of them."""
LEAST_POINTS = 100
"""Fewest shared points on upright surfaces for a pair, about 0.5 m²."""
FEW = 10
"""One of so many points is tested in a first check."""
WEAKEST = 0.02
"""Least fraction of the shared upright surface that must face the weakest direction."""
UPRIGHT = 0.5
"""Largest vertical component of an upright surface's normal."""
NEARLY_ALL = 0.95
"""Fraction of the shared points that count for the farthest of them."""
MOST_ITERATIONS = 60
FINE = 1e-5
"""Step size in metres and radians at which registration ends."""
GLOBAL_VOXEL_M = 0.15
"""Voxel size for registration without poses."""
GLOBAL_ERROR_M = 0.25
"""Distance by which a pose found without a start may be off."""


@dataclass(frozen=True, eq=False)
class Buckets:
    """Points with six coordinates in the order of their cubes' buckets."""

    points: FloatArray
    """(n + r, 6); those of the first REPEATED buckets come again behind the last."""
    first: IntArray
    """First point of each bucket, and their end."""
    order: IntArray
    """Number of each point (n + r,)."""

    @classmethod
    def of(cls, points: FloatArray) -> Buckets:
        """The buckets of points (n, 6); eight and more for each point, so that few share one."""
        count = 1 << len(points).bit_length() + 3
        x, y, z = (points[:, :3] * PER_METRE + SHIFT).astype(np.int64).T
        bucket = (x * ALONG_X + y * ALONG_Y + z) % count
        order = np.argsort(bucket, kind="stable")
        order = np.append(order, order[bucket[order] < REPEATED])
        bucket = bucket[order]
        bucket[len(points) :] += count
        first = np.searchsorted(bucket, np.arange(count + REPEATED + 1))
        return cls(frozen(points[order]), frozen(first, np.int32), frozen(order, np.int64))

    def near(
        self, kernel: Callable[..., None], queries: FloatArray, within: float
    ) -> tuple[BoolArray, BoolArray]:
        """True for points and queries (m, 6) nearer than `within` to one another, by `mark_near`."""
        mask, count = len(self.first) - REPEATED - 2, len(queries)
        query_near, point_near = np.zeros(count, np.int8), np.zeros(len(self.order), np.int8)
        flat = np.ascontiguousarray(queries).ravel()
        kernel(self.points.ravel(), self.first, mask, PER_METRE, flat, within, query_near, point_near)
        points = np.zeros(self.order.max(initial=-1) + 1, dtype=bool)
        points[self.order[point_near > 0]] = True
        return frozen(points, np.bool_), frozen(query_near, np.bool_)


@dataclass(frozen=True, eq=False)
class OrientedCloud:
    """A thinned cloud with its surface normals, in its scanner's frame."""

    points: FloatArray
    """(n, 3)."""
    normals: FloatArray
    """Towards the scanner (n, 3)."""

    @cached_property
    def tree(self) -> Any:
        return cKDTree(self._both(np.eye(4)))

    @cached_property
    def buckets(self) -> Buckets:
        return Buckets.of(self._both(np.eye(4)))

    @cached_property
    def upright(self) -> BoolArray:
        return frozen(np.abs(self.normals[:, 2]) < UPRIGHT, np.bool_)

    def one_of(self, few: int, among: BoolArray) -> OrientedCloud:
        """One of `few` of these points."""
        kept = np.flatnonzero(among)[::few]
        return OrientedCloud(frozen(self.points[kept]), frozen(self.normals[kept]))

    def near(self, other: OrientedCloud, there: FloatArray, within: float) -> BoolArray:
        """True for points of `other` that lie on surfaces of this cloud, at the pose `there` (4, 4)."""
        return self.near_each_other(other, there, within)[1]

    def near_each_other(
        self, other: OrientedCloud, there: FloatArray, within: float
    ) -> tuple[BoolArray, BoolArray]:
        """True for points of this cloud and of `other`, at the pose `there`, on surfaces of one another."""
        kernel = compiled(mark_near, large=False)
        if kernel is not None:
            return self.buckets.near(kernel, other._both(there), within)
        masks = []
        for cloud, one, pose in ((other, self, frozen(np.linalg.inv(there))), (self, other, there)):
            distance, _ = cloud.tree.query(one._both(pose), distance_upper_bound=within)
            masks.append(frozen(np.isfinite(distance), np.bool_))
        return masks[0], masks[1]

    def _both(self, there: FloatArray) -> FloatArray:
        turn = there[:3, :3].T
        return np.hstack([self.points @ turn + there[:3, 3], TURNED_M * self.normals @ turn])


def surface_of(cloud: FloatArray, simulation: Simulation) -> OrientedCloud:
    """A scan's cloud (n, 3), thinned, with its normals.

    Level surfaces are thinned more where registration starts from a pose. Without one, the outlines of the
    floor and the ceiling help to find it.
    """
    import small_gicp

    if len(cloud) <= NEIGHBOURS:
        return OrientedCloud(frozen(np.empty((0, 3))), frozen(np.empty((0, 3))))
    thin, _ = small_gicp.preprocess_points(
        cloud, downsampling_resolution=VOXEL_M, num_neighbors=NEIGHBOURS, num_threads=1
    )
    points, normals = thin.points()[:, :3], thin.normals()[:, :3]
    towards = -np.sign(np.einsum("ij,ij->i", points, normals))
    whole = OrientedCloud(frozen(points), frozen(normals * towards[:, None]))
    if not simulation.poses:
        return whole
    kept = whole.upright.copy()
    kept[np.flatnonzero(~kept)[::LEVEL_FEW]] = True
    return whole.one_of(1, kept)


@dataclass(frozen=True, eq=False)
class Registered:
    """A pair, and the registered pose of its second scan in the first."""

    pair: ScanPair
    there: FloatArray
    """(4, 4)."""
    information: FloatArray
    """Normal matrix of the common surfaces for x, y and heading about the first scanner (3, 3)."""


def registered(
    names: Sequence[str], positions: FloatArray, surfaces: Sequence[OrientedCloud], simulation: Simulation
) -> Iterator[Registered]:
    """Register every pair of scans with shared surfaces; `positions` (n, 3) are the scanner's.

    A second process registers the later pairs, if there are many.
    """
    near = [
        (i, j)
        for i, j in combinations(range(len(names)), 2)
        if math.dist(positions[i], positions[j]) < 2 * simulation.joining_m
    ]
    middle = next((k for k, pair in enumerate(near) if pair[0] >= near[len(near) // 2][0]), 0)

    def those(pairs: Sequence[tuple[int, int]]) -> Iterator[Registered]:
        for i, several in groupby(pairs, key=lambda pair: pair[0]):
            one = replace(surfaces[i])  # what is looked up in it goes with it
            for _, j in several:
                two = _CloudPair(one, surfaces[j], _shift(positions[j] - positions[i]))
                if two.meets and two.shared_points >= LEAST_POINTS:
                    starts = _starts(two, simulation, (i, j))
                    yield _registered((names[i], names[j]), two, starts, simulation)

    with SideWork(lambda: list(those(near[middle:])), forked=len(near) >= MANY) as later:
        yield from those(near[:middle])
        yield from later.result() if later.is_apart else those(near[middle:])


@dataclass(frozen=True, eq=False)
class _CloudPair:
    """Two clouds, and the true pose of the second in the first."""

    one: OrientedCloud
    other: OrientedCloud
    truth: FloatArray
    prepared: dict[tuple[bool, bytes], tuple[Any, Any]] = field(default_factory=dict)
    """Clouds prepared so far, by their masks: many starts come to the same points."""

    @cached_property
    def shared(self) -> tuple[BoolArray, BoolArray]:
        """True for upright points of each cloud that lie on surfaces of the other."""
        one, other = self.one.near_each_other(self.other, self.truth, SAME_M)
        return one & self.one.upright, other & self.other.upright

    @property
    def meets(self) -> bool:
        """True if a few points lie on shared surfaces; this rules out most pairs quickly."""
        few = self.other.one_of(FEW, self.other.upright)
        return bool(self.one.near(few, self.truth, SAME_M).any())

    @property
    def shared_points(self) -> int:
        return min(int(mask.sum()) for mask in self.shared)

    @property
    def share(self) -> float:
        pairs = zip(self.shared, (self.one, self.other), strict=True)
        return min(float(mask.sum() / item.upright.sum()) for mask, item in pairs)

    @property
    def weakest(self) -> tuple[float, float]:
        """Fraction of the shared surface that faces the weakest direction, and its degrees from +x."""
        facing = self.one.normals[self.shared[0]][:, :2]
        weight, axes = np.linalg.eigh(facing.T @ facing / len(facing))
        return float(weight[0]), math.degrees(math.atan2(axes[1, 0], axes[0, 0])) % 180.0

    @property
    def free_deg(self) -> float | None:
        """The unconstrained direction, which almost no shared surface faces, degrees from +x, or None."""
        fraction, direction = self.weakest
        return None if fraction >= WEAKEST else direction

    @property
    def information(self) -> FloatArray:
        """N = Σ j jᵀ (3, 3), j = (nx, ny, p × n): shared points p of the first cloud, and their normals n.

        It is the Hessian of point-to-plane registration in the plane (Censi, ICRA 2007).
        """
        at, facing = (part[self.shared[0]][:, :2] for part in (self.one.points, self.one.normals))
        arm = at[:, 0] * facing[:, 1] - at[:, 1] * facing[:, 0]
        rows = np.column_stack([facing, arm])
        return np.asarray(rows.T @ rows)

    @cached_property
    def farthest_m(self) -> float:
        """Distance of the farthest shared points from the second scanner."""
        shared = np.linalg.norm(self.other.points[self.shared[1]], axis=1)
        return float(np.quantile(shared, NEARLY_ALL)) if len(shared) else 0.0

    def aligned(self, start: FloatArray, simulation: Simulation) -> FloatArray:
        """The pose of the second in the first that registration finds from a start.

        An error of the heading moves far points beyond others that look alike: 2° are 0.5 m at 14 m. So the
        headings within that error are compared first.
        """
        left_m = GLOBAL_ERROR_M
        if simulation.poses:
            start, left_m = self._headed(start, simulation), simulation.pose_error_m + HEADING_M / 2
        return self._aligned(start, ((left_m + SAME_M, left_m + SAME_M / 2), *STAGES))

    def _headed(self, start: FloatArray, simulation: Simulation) -> FloatArray:
        """The start, with the heading within its error that brings most points together."""
        error = math.radians(simulation.pose_error_deg)
        steps = max(1, math.ceil(error * self.farthest_m / HEADING_M))
        few = self.other.one_of(HEADING_FEW, self.other.upright)
        angles = np.linspace(-error, error, 2 * steps + 1)
        poses = [start @ _turned(angle) for angle in angles[np.argsort(np.abs(angles), kind="stable")]]
        return max(poses, key=lambda there: int(self.one.near(few, there, HEADING_M).sum()))

    def _aligned(self, there: FloatArray, stages: Sequence[tuple[float, float]]) -> FloatArray:
        """The pose that these stages find."""
        import small_gicp

        for within, matched in stages:
            one, other = self.one.near_each_other(self.other, there, within)
            if min(one.sum(), other.sum()) <= NEIGHBOURS:
                return there
            target, tree = self._prepared(self.one, one)
            source, _ = self._prepared(self.other, other)
            there = small_gicp.align(
                target, source, tree, there,
                max_correspondence_distance=matched, num_threads=1, max_iterations=MOST_ITERATIONS,
                rotation_epsilon=FINE, translation_epsilon=FINE,
            ).T_target_source  # fmt: skip
        return there

    def _prepared(self, cloud: OrientedCloud, mask: BoolArray) -> tuple[Any, Any]:
        key = (cloud is self.one, mask.tobytes())
        if key not in self.prepared:
            self.prepared[key] = _prepared(cloud.points[mask])
        return self.prepared[key]

    def error(self, there: FloatArray) -> tuple[float, float]:
        """Error of a pose, metres and degrees."""
        return off(np.linalg.inv(self.truth) @ there)


def _registered(
    names: tuple[str, str], two: _CloudPair, starts: Sequence[FloatArray], simulation: Simulation
) -> Registered:
    """The pair registered from its starts up to the first that misses; the worst result counts.

    Starts to either side of the weakest direction that all end in tolerance show that it is constrained.
    """
    ends: list[FloatArray] = []
    for start in starts:
        ends.append(two.aligned(start, simulation))
        if not within_tolerance(*two.error(ends[-1])):
            break
    errors = [two.error(end) for end in ends]
    held = len(starts) > 1 and all(within_tolerance(*error) for error in errors)
    worst = int(np.argmax([error[0] for error in errors]))
    pair = ScanPair(
        *names,
        shared=two.share,
        free_deg=None if held else two.free_deg,
        error_m=errors[worst][0],
        error_deg=max(error[1] for error in errors),
        least_error_m=min(error[0] for error in errors),
        starts=len(errors),
    )
    return Registered(pair, ends[worst], two.information)


def _starts(two: _CloudPair, simulation: Simulation, pair: tuple[int, int]) -> list[FloatArray]:
    """Start poses off to either side of two directions; or the pose found without a start.

    One direction is the weakest of the pair, in which it may slide. The other is random.
    """
    random = np.random.default_rng([simulation.seed, *pair])
    azimuth, turn = random.uniform(0, 2 * math.pi), random.choice((-1.0, 1.0))
    if not simulation.poses:
        return [_without_pose(two.one.points, two.other.points, turn=azimuth)]
    angle = turn * math.radians(simulation.pose_error_deg)
    weak = math.radians(two.weakest[1])
    return [
        _shift(simulation.pose_error_m * side * np.array([math.cos(way), math.sin(way), 0.0]))
        @ two.truth
        @ _turned(side * angle)
        for way in (weak, azimuth)
        for side in (1.0, -1.0)
    ]


def _without_pose(one: FloatArray, other: FloatArray, *, turn: float) -> FloatArray:
    """The pose by KISS-Matcher after the second cloud was rotated about the vertical by `turn`."""
    import kiss_matcher

    away = _turned(turn)
    matcher = kiss_matcher.KISSMatcher(
        kiss_matcher.KISSMatcherConfig(voxel_size=GLOBAL_VOXEL_M, use_quatro=True)
    )
    seen = (other @ away[:3, :3].T).astype(np.float32)
    found = matcher.estimate(seen, one.astype(np.float32))
    there = np.eye(4)
    there[:3, :3], there[:3, 3] = found.rotation, np.ravel(found.translation)
    return there @ away


def _prepared(points: FloatArray) -> tuple[Any, Any]:
    import small_gicp

    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_normals_covariances(cloud, tree, num_neighbors=NEIGHBOURS, num_threads=1)
    return cloud, tree


def off(pose: FloatArray) -> tuple[float, float]:
    """Translation and rotation of a pose (4, 4), metres and degrees."""
    sine = np.linalg.norm(pose[[2, 0, 1], [1, 2, 0]] - pose[[1, 2, 0], [2, 0, 1]]) / 2
    angle = math.atan2(float(sine), (float(np.trace(pose[:3, :3])) - 1) / 2)
    return float(np.linalg.norm(pose[:3, 3])), math.degrees(angle)


def _shift(by: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = by
    return pose


def _turned(angle: float) -> FloatArray:
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return pose

"""Clouds of a scanner with a known truth: whole, missing, shifted, turned, each in its own frame."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely

from stopgo.command_line import main
from stopgo.mission.files.mission_json import read
from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, as_driven, planned_floor
from stopgo.planner.pipeline.measuring import measured
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from tests.planner.test_command import drawn
from tests.recordings.replay.driving import driven, logged
from tests.recordings.replay.test_replaying import log_of

RAYS, RANGE_M = 1440, 30.0
PLAN = ("--range", "3", "--settle", "1", "--scan-time", "8", "--no-refine", "--no-register")


def small_floor(folder: Path) -> PlannedFloor:
    """A planned floor of two rooms."""
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["plan", str(drawn(folder / "floor.dxf")), "-o", str(folder), *PLAN]) == 0
    return planned_floor(folder / "floor.dxf", read(folder / "mission.json"))


@dataclass(frozen=True, eq=False)
class Station:
    """A cloud in the mission's frame, with the pose of its scanner."""

    pose: tuple[float, float, float]
    points: FloatArray


@dataclass(frozen=True, eq=False)
class Site:
    """A floor whose mission was driven as planned, and its clouds."""

    planned: PlannedFloor

    @cached_property
    def replay(self) -> Replay:
        mission = self.planned.mission
        return replay(log_of(logged(driven(mission))), mission, Placing(align="first"))

    @cached_property
    def stations(self) -> list[Station]:
        return [Station(pose, self.seen(pose)) for pose in self.poses]

    @cached_property
    def poses(self) -> list[tuple[float, float, float]]:
        return [(stop.x, stop.y, stop.heading) for stop in self.planned.mission.stops]

    @cached_property
    def walls(self) -> shapely.Geometry:
        shapes = self.planned.space.occluders
        return shapely.union_all([shapely.Polygon(shape.exterior, shape.holes) for shape in shapes])

    def seen(self, pose: tuple[float, float, float], walls: shapely.Geometry | None = None) -> FloatArray:
        """Points (n, 2) where rays from a pose meet walls."""
        angles = np.arange(RAYS) * math.tau / RAYS
        middle = np.array(pose[:2])
        ends = middle + RANGE_M * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        rays = shapely.linestrings(np.stack([np.broadcast_to(middle, ends.shape), ends], axis=1))
        hits = shapely.intersection(rays, (self.walls if walls is None else walls).boundary)
        ranges = shapely.distance(shapely.Point(middle), hits)
        unit = (ends - middle) / RANGE_M
        return (middle + unit * ranges[:, None])[np.isfinite(ranges)]

    def enough(self, poses: list[tuple[float, float, float]], without: BoolArray | None = None) -> bool:
        """True if what these poses see, less some units, is what the mission requires."""
        seen = as_driven(self.planned, np.array(poses).reshape(-1, 3))
        shown = seen.driven if without is None else seen.driven & ~without
        return not seen.totals.coverage(shown).short


Given = tuple[list[FloatArray], str]
"""Clouds, and the truth: yes, no or unknown."""
CloudCase = Callable[[Site, np.random.Generator], Given]


def _all(site: Site) -> list[FloatArray]:
    return [station.points for station in site.stations]


def whole(site: Site, chance: np.random.Generator) -> Given:
    return _all(site), "yes"


def noisy(site: Site, chance: np.random.Generator) -> Given:
    """8 mm of noise."""
    return [points + chance.normal(0, 0.008, points.shape) for points in _all(site)], "yes"


def with_people(site: Site, chance: np.random.Generator) -> Given:
    """A fifth of the points is of things that stand around."""
    return [
        np.concatenate([points, points[::5] * 0.7 + points.mean(axis=0) * 0.3]) for points in _all(site)
    ], "yes"


def twice(site: Site, chance: np.random.Generator) -> Given:
    return [*_all(site), *_all(site)], "yes"


def one_missing(site: Site, chance: np.random.Generator) -> Given:
    left = int(chance.integers(len(site.stations)))
    poses = [pose for k, pose in enumerate(site.poses) if k != left]
    kept = [points for k, points in enumerate(_all(site)) if k != left]
    return kept, "yes" if site.enough(poses) else "no"


def one_alone(site: Site, chance: np.random.Generator) -> Given:
    return _all(site)[:1], "yes" if site.enough(site.poses[:1]) else "no"


def a_wall_missing(site: Site, chance: np.random.Generator) -> Given:
    """All points of one element are missing: it was not built, and nothing behind it was seen."""
    targets = site.planned.space.targets
    element = targets.element[targets.unit_segment]
    most = int(np.bincount(element).argmax())
    gone = shapely.union_all(shapely.points(targets.unit_xy[element == most])).buffer(0.06)
    clouds = [points[~shapely.contains(gone, shapely.points(points))] for points in _all(site)]
    return clouds, "yes" if site.enough(site.poses, element == most) else "no"


def one_shifted(site: Site, chance: np.random.Generator) -> Given:
    first, *others = _all(site)
    return [first + np.array([0.2, 0.0]), *others], "unknown"


def all_shifted(site: Site, chance: np.random.Generator) -> Given:
    return [points + np.array([0.14, -0.14]) for points in _all(site)], "unknown"


def _turned(points: FloatArray, about: tuple[float, float], turn: float) -> FloatArray:
    cos, sin = math.cos(turn), math.sin(turn)
    return (points - about) @ np.array([[cos, sin], [-sin, cos]]) + about


def one_turned(site: Site, chance: np.random.Generator) -> Given:
    """One station is turned by 2 degrees."""
    first, *others = site.stations
    return [_turned(first.points, first.pose[:2], 0.035), *(one.points for one in others)], "unknown"


def each_in_its_own_frame(site: Site, chance: np.random.Generator) -> Given:
    return [
        _turned(one.points - one.pose[:2], (0.0, 0.0), -one.pose[2] + 0.4 * k)
        for k, one in enumerate(site.stations)
    ], "unknown"


def mirrored(site: Site, chance: np.random.Generator) -> Given:
    return [points * (1.0, -1.0) for points in _all(site)], "unknown"


def in_millimetres(site: Site, chance: np.random.Generator) -> Given:
    return [1000.0 * points for points in _all(site)], "unknown"


def empty(site: Site, chance: np.random.Generator) -> Given:
    return [np.empty((0, 2)) for _ in site.stations], "unknown"


CASES: tuple[CloudCase, ...] = (
    whole,
    noisy,
    with_people,
    twice,
    one_missing,
    one_alone,
    a_wall_missing,
    one_shifted,
    all_shifted,
    one_turned,
    each_in_its_own_frame,
    mirrored,
    in_millimetres,
    empty,
)


@dataclass(frozen=True)
class CloudAnswer:
    """Answer to clouds, with their truth."""

    name: str
    truth: str
    answer: str
    text: str

    @property
    def kind(self) -> str:
        if self.answer == "unknown":
            return "right" if self.truth == "unknown" else "untold"
        return "right" if self.answer == self.truth else f"false {self.answer}"


def cloud_answers(planned: PlannedFloor) -> Iterator[CloudAnswer]:
    """Yield the answer to each case on a floor."""
    site = Site(planned)
    driven_well = site.replay.with_sight(as_driven(planned, site.replay.scanned_from))
    for number, case in enumerate(CASES):
        clouds, truth = case(site, np.random.default_rng(number))
        found = measured(planned, clouds, least_sweeps=1, surveyed=True)
        judged = drive_verdict(driven_well.with_measured(found))
        yield CloudAnswer(case.__name__, truth, judged.answer, judged.text)

"""A run as it was logged: the robot's poses and events, whatever kind of file they were read from.

Times are nanoseconds on the robot's clock (since 1970 where the clock knows the date). Poses are metres and
radians counter-clockwise from +x. Both are in the mission's frame: the reader of the log has transformed
them, and `RunLog.alignment` records the transform.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from stopgo.mission.frames.transform import Transform
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.run.events import Aborted, AnyEvent, Finished, Started
from stopgo.mission.run.health_text import HealthWords
from stopgo.mission.run.pose_gaps import gap_limit_ns, gaps_after


@dataclass(frozen=True, eq=False)
class Track:
    """Poses of a robot, sorted by time; where times are equal, in the order of the log."""

    ns: IntArray
    """Times (n,), nanoseconds on the robot's clock."""
    xy: FloatArray
    """Positions (n, 2), metres in the mission's frame."""
    heading: FloatArray
    """Headings (n,), radians counter-clockwise from +x."""
    restarts_ns: tuple[int, ...] = ()
    """Times of the first data after each restart of the robot: no path joins the poses around them."""

    @classmethod
    def empty(cls) -> Track:
        return cls.of((), (), ())

    @classmethod
    def of(
        cls, ns: ArrayLike, xy: ArrayLike, heading: ArrayLike, *, restarts_ns: Iterable[int] = ()
    ) -> Track:
        """A track from poses in any order.

        Raises
        ------
        ValueError
            When the arrays differ in length, or a pose is not finite: a reader leaves such poses out and
            counts them in `LogSource.lost`.
        """
        times = np.asarray(ns, dtype=np.int64).reshape(-1)
        positions = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        headings = np.asarray(heading, dtype=np.float64).reshape(-1)
        if not len(times) == len(positions) == len(headings):
            raise ValueError(f"{len(times)} times, {len(positions)} positions and {len(headings)} headings")
        if not (np.isfinite(positions).all() and np.isfinite(headings).all()):
            raise ValueError("a pose is not finite")
        order = np.argsort(times, kind="stable")
        rows = frozen(times[order], np.int64), frozen(positions[order]), frozen(headings[order])
        return cls(*rows, tuple(restarts_ns))

    def __len__(self) -> int:
        return len(self.ns)

    @cached_property
    def gaps(self) -> BoolArray:
        """Mask of the poses that a gap follows (n - 1,)."""
        return gaps_after(self.ns, self.restarts_ns)

    @property
    def length_m(self) -> float:
        """Distance travelled, from pose to pose; what was driven in a gap is not known and not counted."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T)[~self.gaps].sum()) if len(self) > 1 else 0.0

    @property
    def paths(self) -> list[FloatArray]:
        """Positions between the gaps, as lines (k, 2)."""
        return np.split(self.xy, np.flatnonzero(self.gaps) + 1) if len(self) else []

    def between(self, begin_ns: int, end_ns: int) -> Track:
        """The poses from `begin_ns` to `end_ns`, both included."""
        first, behind = np.searchsorted(self.ns, [begin_ns, end_ns + 1]).tolist()
        return self._rows(slice(first, max(first, behind)))

    def last_until(self, ns: int) -> int | None:
        """Index of the newest pose at or before `ns`; None if there is none."""
        found = int(np.searchsorted(self.ns, ns, side="right")) - 1
        return found if found >= 0 else None

    def is_known(self, index: int, ns: int) -> bool:
        """True if no gap is between the pose at an index and the time `ns`, where it is the newest."""
        steps = np.diff(self.ns)
        return ns - int(self.ns[index]) <= gap_limit_ns(steps[steps > 0])

    def _rows(self, rows: slice) -> Track:
        kept = frozen(self.ns[rows], np.int64), frozen(self.xy[rows]), frozen(self.heading[rows])
        return Track(*kept, self.restarts_ns)


@dataclass(frozen=True)
class LogSource:
    """Source of a log, and how much of it could not be read."""

    name: str
    """The file's name, without its folders."""
    format: str
    """Such as `journal`, `rrd`, `mcap`, `tlog`."""
    digest: str
    """sha256 of the file's bytes, hexadecimal; empty where there is no file."""
    messages: int
    """Messages or rows that were read."""
    lost: int = 0
    """Those that were cut off, damaged or not finite."""
    notes: tuple[str, ...] = ()
    """Notes for a reader of the log, a sentence each."""


@dataclass(frozen=True)
class Alignment:
    """Transform of a log's frame to the mission's: rotated by `heading`, then shifted by (x, y)."""

    how: str
    """In words, such as `given by --map`, `first pose at the start`, `fitted to 9 scanned stops`."""
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    time_offset_ns: int = 0
    """Added to the log's times."""
    residual_rms_m: float | None = None
    """Residual between the pairs of a fit; None where nothing was fitted."""
    residual_max_m: float | None = None
    pairs: int = 0
    """Pairs of positions that were fitted."""

    @classmethod
    def by(cls, transform: Transform, how: str, pairs: int = 0) -> Alignment:
        """Return an alignment without residuals."""
        return cls(how, transform.x, transform.y, transform.heading, pairs=pairs)

    @property
    def transform(self) -> Transform:
        return Transform(x=self.x, y=self.y, heading=self.heading)

    @property
    def text(self) -> str:
        """The transform and its residuals in one line."""
        line = (
            f"{self.how}: rotated by {math.degrees(self.heading):.3f}°, shifted by "
            f"({self.x:.3f}, {self.y:.3f}) m, times by {self.time_offset_ns / 1e9:+.3f} s"
        )
        if self.residual_rms_m is None:
            return line
        rms, greatest = 1000 * self.residual_rms_m, 1000 * (self.residual_max_m or 0.0)
        return f"{line}; residuals of {self.pairs} pairs: {rms:.1f} mm rms, {greatest:.1f} mm at most"


@dataclass(frozen=True, eq=False)
class RunLog:
    """One run of one robot; values that a third-party log does not contain are None."""

    robot: str
    run_id: str | None
    mission_id: str | None
    revision: int | None
    """The revision that was followed last."""
    source: LogSource
    poses: Track = field(default_factory=Track.empty)
    events: tuple[AnyEvent, ...] = ()
    """In the order of their numbers."""
    alignment: Alignment | None = None
    """None where the log is in the mission's frame already."""
    health: tuple[HealthWords, ...] = ()
    """Health of the robot at the run's begin, at each change and at the end; empty if it was not recorded."""

    @property
    def began_ns(self) -> int | None:
        """Start of the run; where no event reports it, the first time that anything was logged."""
        started = [event.robot_ns for event in self.events if isinstance(event, Started)]
        return started[0] if started else self._edge(0)

    @property
    def ended_ns(self) -> int | None:
        """End of the run; where no event reports it, the last time that anything was logged."""
        ends = [event.robot_ns for event in self.events if isinstance(event, Finished | Aborted)]
        return ends[-1] if ends else self._edge(-1)

    @property
    def ended(self) -> bool:
        """True if the log contains the end of the run."""
        return any(isinstance(event, Finished | Aborted) for event in self.events)

    @property
    def duration_s(self) -> float:
        """Seconds from the begin to the end; 0 where nothing was logged."""
        begin, end = self.began_ns, self.ended_ns
        return 0.0 if begin is None or end is None else (end - begin) / 1e9

    @property
    def revisions(self) -> tuple[int, ...]:
        """The mission's revisions that the run followed, in this order."""
        return tuple(dict.fromkeys(event.revision for event in self.events))

    def seconds(self, ns: ArrayLike) -> FloatArray:
        """Seconds since the run began at times (n,) on the robot's clock."""
        return frozen((np.asarray(ns, dtype=np.int64) - (self.began_ns or 0)) / 1e9)

    def _edge(self, index: int) -> int | None:
        """The time of the first (0) or last (-1) thing that was logged."""
        times = [event.robot_ns for event in (self.events[:1] if index == 0 else self.events[-1:])]
        times += self.poses.ns[:1].tolist() if index == 0 else self.poses.ns[-1:].tolist()
        return None if not times else min(times) if index == 0 else max(times)

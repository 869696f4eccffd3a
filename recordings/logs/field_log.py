"""Content of a robot's own log, in the log's own frames and times: the result of every reader.

Times are nanoseconds on the clock that `FieldLog.clock` names, lengths metres, angles radians
counter-clockwise from +x. Nothing here depends on a mission: `stopgo.recordings.replay` compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stopgo.mission.console.table import counted
from stopgo.mission.document import Mission
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.mavlink.items import Item
from stopgo.mission.run.events import AnyEvent
from stopgo.recordings.logs.clock_steps import mended_times

Stamps = Literal["header", "log"]
RemarkKind = Literal["mode", "command", "trigger", "reached", "text"]
Tick = Callable[[float], None]
"""Progress callback; its argument is the fraction of the file read so far, 0 to 1."""


@dataclass(frozen=True)
class Reading:
    """Options for reading a log."""

    stamps: Stamps = "header"
    """Time of a message: its own stamp if it has one (`header`), or the time of logging (`log`)."""
    frame: str | None = None
    """Frame of the poses wanted from transforms; None: `map`, else `odom`."""
    tick: Tick = lambda fraction: None


@dataclass(frozen=True)
class Channel:
    """Kind of message in a log."""

    name: str
    """Topic, or name of the message."""
    kind: str
    """Type; empty if name and type are the same."""
    count: int


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of one robot from one source, ordered by time."""

    source: str
    """Topic or message that contains the poses."""
    frame: str
    """Frame of the positions, as the log calls it."""
    ns: IntArray
    """(n,)."""
    xy: FloatArray
    """(n, 2)."""
    heading: FloatArray
    """Headings (n,); NaN where the source has none."""
    robot: str = ""
    """Name of the robot, if a log may contain several."""
    rank: int = 0
    """Priority of the source: the least rank is used, unless the user names another source."""
    origin: SiteOrigin | None = None
    """Position of (0, 0) on the earth, if the source gives it; x is then east and y north."""
    rule: str = "wgs84"
    """Key of `stopgo.mission.frames.geodesy.RULES`: the source's conversion of degrees into metres."""
    truth: bool = False
    """True for a simulator's true poses; they are never used as the robot's own estimate."""
    oddities: tuple[str, ...] = ()
    astray: float = 0.0
    """Share of the poses that was left out, as the robot would have jumped there and back."""
    height: FloatArray | None = None
    """Heights (n,), metres upwards from any level; None where the source has none."""
    restarts_ns: tuple[int, ...] = ()
    """Times of the first data after each restart of the robot, where the log reports it."""
    steps_ns: tuple[int, ...] = ()
    """Times at which the clock was set: how much time passed there is unknown."""
    own_clock: bool = False
    """True if the times are of the clock that all messages in the log have: a step forward is a gap."""
    rate: float = 1.0
    """Seconds that passed for the robot in a second of these times: another number in a fast simulation."""

    @property
    def seconds(self) -> float:
        """Duration from the first pose to the last."""
        return float(self.ns[-1] - self.ns[0]) / 1e9 if len(self.ns) else 0.0

    @property
    def metres(self) -> float:
        """Length along the poses, noise included."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum()) if len(self.xy) > 1 else 0.0


@dataclass(frozen=True)
class Remark:
    """Text or event in a log at one moment."""

    ns: int
    kind: RemarkKind
    text: str
    number: int | None = None
    """Number of the stop or mission item, if there is one."""


@dataclass(frozen=True)
class LoggedMission:
    """MAVLink mission that the vehicle holds: uploaded to it, or read back from it."""

    ns: int
    items: tuple[Item, ...]
    """Items without home."""
    autopilot: str
    complete: bool = True
    home: SiteOrigin | None = None
    read_back: bool = False
    """True if the vehicle sent the list, on request, and did not receive it."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Points that a scanner measured at one moment, in its own frame."""

    ns: int
    source: str
    frame: str
    xyz: FloatArray
    """(n, 3)."""


Sweeps = Callable[[], Iterator[Sweep]]
"""Function that reads the log again for its scans: they may be larger than memory."""


def no_sweeps() -> Iterator[Sweep]:
    """Return the scans of a log without scans."""
    return iter(())


@dataclass(frozen=True, eq=False)
class FieldLog:
    """Content of a log that a replay needs; arrays are read-only."""

    path: str
    format: str
    digest: str
    """sha256 of the bytes; of several files, one after another."""
    messages: int
    clock: str
    """`wall`, `since boot` or `simulated`."""
    begin_ns: int
    end_ns: int
    channels: tuple[Channel, ...] = ()
    poses: tuple[Poses, ...] = ()
    uploads: tuple[LoggedMission, ...] = ()
    remarks: tuple[Remark, ...] = ()
    events: tuple[AnyEvent, ...] = ()
    """Events, only in stopgo's own logs."""
    missions: tuple[Mission, ...] = ()
    """Missions, only in stopgo's own logs."""
    battery: tuple[tuple[int, float], ...] = ()
    """Times, and charges as fractions from 0 to 1."""
    mounts: tuple[tuple[str, float, float, float], ...] = ()
    """Frames of sensors, and the pose of each on the robot: x, y, heading."""
    sweeps: Sweeps = field(default=no_sweeps)
    lost: str = ""
    """Unreadable part of a damaged log; empty if everything could be read."""
    oddities: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        return (self.end_ns - self.begin_ns) / 1e9


def poses_of(
    source: str,
    frame: str,
    ns: ArrayLike,
    xy: ArrayLike,
    heading: ArrayLike,
    *,
    height: ArrayLike | None = None,
    own_clock: bool = False,
    **more: Any,
) -> Poses | None:
    """Return the finite poses in order of time; None if there is none.

    `more` are further fields of `Poses`.
    """
    times, positions = np.asarray(ns, np.int64), np.asarray(xy, float).reshape(-1, 2)
    finite = np.all(np.isfinite(positions) & (np.abs(positions) < FARTHEST), axis=1)
    mended = mended_times(times[finite], positions[finite], forward=not own_clock)
    times = times.copy()
    times[finite] = mended.ns
    not_finite = int((~finite).sum())
    finite[finite] = mended.kept
    oddities = (*mended.lines, *oddities_of(times, positions, finite, not_finite))
    order = np.flatnonzero(finite)[np.argsort(times[finite], kind="stable")]
    if not len(order):
        return None
    astray = _astray(times[order], positions[order])
    if astray.any():
        oddities = (
            *oddities,
            f"{int(astray.sum())} of {len(order)} poses lie far from both neighbours; left out",
        )
        more["astray"] = float(astray.mean())
        order = order[~astray]
    headings = frozen(np.asarray(heading, float)[order])
    heights = None if height is None else frozen(np.asarray(height, float)[order])
    return Poses(
        source, frame, frozen(times[order], np.int64), frozen(positions[order]), headings,
        oddities=oddities, height=heights, steps_ns=mended.steps_ns, own_clock=own_clock, **more,
    )  # fmt: skip


WALL_S = 1e9
"""Times from September 2001 on count as seconds since 1970."""
LATEST_S = 9e9
"""Limit of times: more nanoseconds have no int64."""
FARTHEST = 1e9
"""Limit of coordinates in metres, as in a plan's parameters."""
GAP_S = 1.0
"""Shortest gap that is reported; it must also be ten times as long as usual."""
JUMP_M, JUMP_M_S = 0.5, 5.0
"""Distance and speed from which on the step between two poses is a jump."""


def apart(xy: FloatArray, least_m: float) -> IntArray:
    """Return indices of the first position and of each that is so far from the one before it (n, 2)."""
    at = [0]
    for k in range(1, len(xy)):
        if math.dist(xy[k], xy[at[-1]]) >= least_m:
            at.append(k)
    return np.array(at)


def _astray(ns: IntArray, xy: FloatArray) -> BoolArray:
    """True for poses (n, 2) to which the robot would have jumped, and back to where it was."""
    astray = np.zeros(len(ns), bool)
    if len(ns) > 2:
        limit = np.maximum(JUMP_M, JUMP_M_S * np.diff(ns) / 1e9)
        jump = np.hypot(*np.diff(xy, axis=0).T) > limit
        near = np.hypot(*(xy[2:] - xy[:-2]).T) <= limit[1:] + limit[:-1]
        astray[1:-1] = jump[1:] & jump[:-1] & near
    return astray


def oddities_of(ns: IntArray, xy: FloatArray, kept: np.ndarray, not_finite: int) -> tuple[str, ...]:
    """Return gaps, jumps and times that run back in the kept poses, and how many are not finite."""
    lines = []
    if not_finite:
        lines.append(f"{not_finite} of {len(kept)} poses are not finite; left out")
    step = np.diff(ns[kept]) / 1e9
    back = int((step < 0).sum())
    if back:
        lines.append(f"time runs back {counted(back, 'time')}, by up to {-step.min():.3f} s; ordered by time")
    order = np.argsort(ns[kept], kind="stable")
    times, positions = ns[kept][order], xy[kept][order]
    step = np.diff(times) / 1e9
    usual = float(np.median(step)) if len(step) else 0.0
    gaps = step[step > max(GAP_S, 10 * usual)]
    if len(gaps):
        lines.append(
            f"{counted(len(gaps), 'gap')} without poses, {gaps.sum():.1f} s together, "
            f"the longest {gaps.max():.1f} s"
        )
    moved = np.hypot(*np.diff(positions, axis=0).T) if len(positions) > 1 else np.empty(0)
    jumps = moved[(moved > JUMP_M) & (moved > JUMP_M_S * np.maximum(step, 1e-9))]
    if len(jumps):
        lines.append(f"{counted(len(jumps), 'jump')} of position, the largest {jumps.max():.2f} m")
    return tuple(lines)


def fixes_of(
    source: str, rule: str, ns: ArrayLike, degrees: ArrayLike, bearing: ArrayLike, **more: Any
) -> Poses | None:
    """Return positions on the earth as poses, in metres east and north of the first one.

    Parameters
    ----------
    degrees
        Latitudes and longitudes (n, 2); invalid ones, such as 0, 0, are left out.
    bearing
        Degrees clockwise from north (n,).
    """
    positions = np.asarray(degrees, float).reshape(-1, 2)
    finite = (
        np.isfinite(positions).all(axis=1)
        & (np.abs(positions) <= (90, 180)).all(axis=1)
        & (positions != 0).any(axis=1)
    )
    if not finite.any():
        return None
    lat, lon = positions[finite][0]
    origin = SiteOrigin(lat=float(lat), lon=float(lon), alt=0.0, heading_deg=0.0)
    xy = np.full(positions.shape, np.nan)
    xy[finite] = [from_geodetic(origin, Geodetic(lat=a, lon=b), rule) for a, b in positions[finite].tolist()]
    heading = np.radians(90.0 - np.asarray(bearing, float))
    return poses_of(source, "earth", ns, xy, heading, origin=origin, rule=rule, **more)

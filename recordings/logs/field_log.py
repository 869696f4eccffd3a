"""What a robot's own log holds, in the log's own frames and times: the noun that every reader makes.

Times are nanoseconds on the clock that `FieldLog.clock` names, lengths metres, angles radians
counter-clockwise from +x. Nothing here knows a mission: `stopgo.recordings.replay` lays a log beside one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stopgo.mission.document import Mission
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.mavlink.items import Item
from stopgo.mission.run.events import AnyEvent

Stamps = Literal["header", "log"]
RemarkKind = Literal["mode", "command", "trigger", "reached", "text"]
Tick = Callable[[float], None]
"""Is told now and then which share of a file has been read, 0 to 1."""


@dataclass(frozen=True)
class Reading:
    """How a log is to be read."""

    stamps: Stamps = "header"
    """Whether a message's own stamp counts, where it has one, or when the log took it in."""
    frame: str | None = None
    """Frame of the poses wanted from transforms; None: `map`, else `odom`."""
    tick: Tick = lambda share: None


@dataclass(frozen=True)
class Channel:
    """One kind of message in a log."""

    name: str
    """The topic, or what the message is called."""
    kind: str
    """Its type; empty where name and type are one."""
    count: int


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of one robot from one source, ordered by time."""

    source: str
    """The topic or message they are from."""
    frame: str
    """What the positions are relative to, as the log calls it."""
    ns: IntArray
    """(n,)."""
    xy: FloatArray
    """(n, 2)."""
    heading: FloatArray
    """(n,); NaN where the source tells none."""
    robot: str = ""
    """Which robot, where a log may hold several."""
    rank: int = 0
    """Of several sources the one with the least rank is taken, unless the user names another."""
    origin: SiteOrigin | None = None
    """Where on earth (0, 0) is, where the source tells that; x is then east and y north."""
    rule: str = "wgs84"
    """One of `stopgo.mission.frames.geodesy.RULES`: how whoever measured them turns degrees into metres."""
    truth: bool = False
    """From a simulator, which knows where the robot was; never taken for what the robot knew."""
    oddities: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """From the first pose to the last."""
        return float(self.ns[-1] - self.ns[0]) / 1e9 if len(self.ns) else 0.0

    @property
    def metres(self) -> float:
        """Along the poses, noise included."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum()) if len(self.xy) > 1 else 0.0


@dataclass(frozen=True)
class Remark:
    """Something a log tells at one moment."""

    ns: int
    kind: RemarkKind
    text: str
    number: int | None = None
    """Of the stop or the mission's item, where it carries one."""


@dataclass(frozen=True)
class LoggedMission:
    """A MAVLink mission that the vehicle was given."""

    ns: int
    items: tuple[Item, ...]
    """Without home."""
    autopilot: str
    complete: bool = True
    home: SiteOrigin | None = None


@dataclass(frozen=True, eq=False)
class Sweep:
    """Points that a scanner measured at one moment, in its own frame."""

    ns: int
    source: str
    frame: str
    xyz: FloatArray
    """(n, 3)."""


Sweeps = Callable[[], Iterator[Sweep]]
"""Reads the log again for its scans: they may be larger than memory."""


def no_sweeps() -> Iterator[Sweep]:
    """Of a log without scans."""
    return iter(())


@dataclass(frozen=True, eq=False)
class FieldLog:
    """Everything of a log that a replay needs; arrays are read-only."""

    path: str
    format: str
    digest: str
    """sha256 of the bytes, of several files one after another."""
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
    """Of stopgo's own logs."""
    missions: tuple[Mission, ...] = ()
    """That stopgo's own logs carry."""
    battery: tuple[tuple[int, float], ...] = ()
    """Times, and shares of 0 to 1."""
    mounts: tuple[tuple[str, float, float, float], ...] = ()
    """Sensors' frames, and where each sits on the robot: x, y, heading."""
    sweeps: Sweeps = field(default=no_sweeps)
    lost: str = ""
    """What of a damaged log could not be read; empty if nothing."""
    oddities: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        return (self.end_ns - self.begin_ns) / 1e9


def poses_of(
    source: str, frame: str, ns: ArrayLike, xy: ArrayLike, heading: ArrayLike, **told: Any
) -> Poses | None:
    """Poses in order of time, without those that are no numbers; None if none is left.

    `told` are further fields of `Poses`.
    """
    times, places = np.asarray(ns, np.int64), np.asarray(xy, float).reshape(-1, 2)
    good = np.isfinite(places).all(axis=1) & (np.abs(places) < FARTHEST).all(axis=1)
    oddities = oddities_of(times, places, good)
    order = np.flatnonzero(good)[np.argsort(times[good], kind="stable")]
    if not len(order):
        return None
    headings = frozen(np.asarray(heading, float)[order])
    return Poses(
        source, frame, frozen(times[order], np.int64), frozen(places[order]), headings,
        **{"oddities": oddities, **told},
    )  # fmt: skip


FARTHEST = 1e9
"""Metres, as in a plan's settings."""
GAP_S = 1.0
"""A silence as long as this, and ten times as long as usual, is told."""
JUMP_M, JUMP_M_S = 0.5, 5.0
"""A pose that is farther from the one before than this, at more than this speed, has jumped."""


def oddities_of(ns: IntArray, xy: FloatArray, good: np.ndarray) -> tuple[str, ...]:
    """Gaps, jumps, times that run back and poses that are no numbers, a line each."""
    lines = []
    if not good.all():
        lines.append(f"{int((~good).sum())} of {len(good)} poses are no numbers, left out")
    step = np.diff(ns[good]) / 1e9
    back = int((step < 0).sum())
    if back:
        lines.append(f"time runs back {back} times, by up to {-step.min():.3f} s; ordered by time")
    order = np.argsort(ns[good], kind="stable")
    times, places = ns[good][order], xy[good][order]
    step = np.diff(times) / 1e9
    usual = float(np.median(step)) if len(step) else 0.0
    gaps = step[step > max(GAP_S, 10 * usual)]
    if len(gaps):
        lines.append(
            f"{len(gaps)} gaps without poses, {gaps.sum():.1f} s together, the longest {gaps.max():.1f} s"
        )
    moved = np.hypot(*np.diff(places, axis=0).T) if len(places) > 1 else np.empty(0)
    jumps = moved[(moved > JUMP_M) & (moved > JUMP_M_S * np.maximum(step, 1e-9))]
    if len(jumps):
        lines.append(f"{len(jumps)} jumps of position, the largest {jumps.max():.2f} m")
    return tuple(lines)


def fixes_of(
    source: str, rule: str, ns: ArrayLike, degrees: ArrayLike, bearing: ArrayLike, **told: Any
) -> Poses | None:
    """Places on the earth as poses, metres east and north of the first of them.

    Parameters
    ----------
    degrees
        Latitudes and longitudes (n, 2); those that are no place, 0, 0 among them, are left out.
    bearing
        Degrees clockwise from north (n,).
    """
    places = np.asarray(degrees, float).reshape(-1, 2)
    good = (
        np.isfinite(places).all(axis=1)
        & (np.abs(places) <= (90, 180)).all(axis=1)
        & (places != 0).any(axis=1)
    )
    if not good.any():
        return None
    lat, lon = places[good][0]
    origin = SiteOrigin(lat=float(lat), lon=float(lon), alt=0.0, heading_deg=0.0)
    xy = np.full(places.shape, np.nan)
    xy[good] = [from_geodetic(origin, Geodetic(lat=a, lon=b), rule) for a, b in places[good].tolist()]
    heading = np.radians(90.0 - np.asarray(bearing, float))
    return poses_of(source, "earth", ns, xy, heading, origin=origin, rule=rule, **told)

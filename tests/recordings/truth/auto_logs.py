"""Logs of a simulated rover that drives a mission in AUTO, and of which the truth is known.

A station logs its telemetry (.tlog), and the autopilot writes its own log (.BIN, .ulg), a file for each boot.
A witness on the vehicle writes down where it truly stood at each scan, and whether the scan succeeded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from stopgo.bridge.mavlink.simulated.vehicle import Vehicle
from stopgo.mission.document import Mission, Stop
from stopgo.mission.errors import InputError, Undecided
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.matching import least_stay_s
from stopgo.recordings.replay.replaying import replay, replay_parts
from tests.recordings.logs.writing import write_telemetry_log
from tests.recordings.replay.auto_vehicle import AFTER_S, ROVER, Orders, heard, mission
from tests.recordings.truth.black_box import BlackBox, dataflash_of, ulog_of

FOREIGN = 250
WIDE_M, NARROW_M = 0.4, 0.05
"""A tolerance that the vehicle holds, and one that it does not."""
STILL_M, SHORTEST_S = 0.03, 0.2
"""Movement of a vehicle that stands, and the error of the time that it does."""


Truth = Literal["scanned", "tried", "stood"]
"""Scans that succeeded; those that were triggered; standstills as long as a scan."""


@dataclass
class Shots:
    """Where the vehicle truly stood when each scan ended, and when it stood still."""

    at: dict[Truth, list[tuple[float, float]]] = field(
        default_factory=lambda: {"scanned": [], "tried": [], "stood": []}
    )
    _since: tuple[int, float, float] | None = None
    """Begin and place of the standstill under way."""

    def watch(self, vehicle: Vehicle, least_s: float) -> None:
        """See where the vehicle truly is at the end of each scan, and after `least_s` of a standstill."""
        end, advance = vehicle.camera.end, vehicle.advance

        def ended(now_ns: int, boot_ms: int) -> tuple[Any, str]:
            message, why = end(now_ns, boot_ms)
            pose = vehicle.rover.at(now_ns)[0]
            for kind in ("tried",) if why else ("tried", "scanned"):
                self.at[kind].append((pose.x, pose.y))
            return message, why

        def advanced() -> None:
            advance()
            self._stands(vehicle, least_s)

        vehicle.camera.end = ended  # type: ignore[method-assign]
        vehicle.advance = advanced  # type: ignore[method-assign]

    def _stands(self, vehicle: Vehicle, least_s: float) -> None:
        pose = vehicle.rover.at(vehicle.now_ns)[0]
        if self._since is None or math.dist(self._since[1:], (pose.x, pose.y)) > STILL_M:
            self._since = (vehicle.now_ns, pose.x, pose.y)
        elif vehicle.now_ns - self._since[0] > least_s * 1e9:
            self.at["stood"].append((pose.x, pose.y))

    def good(self, plan: Mission, truth: Truth) -> bool:
        """True if each stop has a scan, or what counts for one, within its tolerance."""
        return all(
            any(math.dist(at, (stop.x, stop.y)) <= stop.tolerance_m for at in self.at[truth])
            for stop in plan.stops
        )


@dataclass(frozen=True)
class Course:
    """Events of a run: faults of the vehicle, and orders by seconds from AUTO."""

    faults: tuple[str, ...] = ()
    orders: Callable[[Orders], dict[float, Any]] = lambda go: {}
    tolerance_m: float = WIDE_M
    seconds: float = AFTER_S


def _beside(go: Orders) -> Orders:
    """The same mission, all its stops 0.9 m aside."""

    def moved(stop: Stop) -> Stop:
        approach = tuple((x + 0.9, y) for x, y in stop.approach)
        return msgspec.structs.replace(stop, x=stop.x + 0.9, approach=approach)

    plan = go.plan
    start = msgspec.structs.replace(plan.start, x=plan.start.x + 0.9)
    other = msgspec.structs.replace(plan, start=start, stops=tuple(map(moved, plan.stops)))
    return Orders(other, go.autopilot)


COURSES: dict[str, Course] = {
    "as planned": Course(),
    "beside its stops": Course(tolerance_m=NARROW_M),
    "a stop jumped over": Course(orders=lambda go: {0.5: go.jump("S2")}),
    "two stops jumped over": Course(orders=lambda go: {0.5: go.jump("S3")}),
    "the last stop jumped over": Course(orders=lambda go: {0.5: go.jump("S3"), 3.0: go.jump("S1")}),
    "held and sent on": Course(orders=lambda go: {1.0: go.hold(), 20.0: go.auto()}),
    "held three times": Course(
        orders=lambda go: {k: go.hold() if k % 2 else go.auto() for k in (1, 4, 7, 10, 21, 26)}
    ),
    "held in a scan": Course(orders=lambda go: {7.0: go.hold(), 9.0: go.auto()}),
    "held at a stop, and sent past it": Course(
        orders=lambda go: {5.5: go.hold(), 20.0: (*go.jump("S2"), *go.auto())}
    ),
    "a stop visited twice": Course(orders=lambda go: {14.0: go.jump("S1")}),
    "the whole list again": Course(
        orders=lambda go: {40.0: (*go.disarm(), *go.arm(), *go.auto())}, seconds=100.0
    ),
    "given up": Course(orders=lambda go: {14.0: go.hold()}),
    "given up at once": Course(orders=lambda go: {2.0: go.hold()}),
    "switched off": Course(orders=lambda go: {18.0: go.disarm()}),
    "a scan failed": Course(faults=("scanner@2",)),
    "a jump of the estimate": Course(faults=("jump@20=1.5",)),
    "another list by a foreign station": Course(orders=lambda go: {9.0: _beside(go).upload(FOREIGN)}),
    "another list before the first stop": Course(orders=lambda go: {0.5: _beside(go).upload(FOREIGN)}),
    "another list, and ours again": Course(
        orders=lambda go: {4.0: _beside(go).upload(FOREIGN), 6.0: go.upload()}
    ),
    "our list by a foreign station": Course(orders=lambda go: {9.0: go.upload(FOREIGN)}),
    "our list read back": Course(orders=lambda go: {12.0: go.read_back()}),
    "rebooted and sent on": Course(
        faults=("restart@16=3",), orders=lambda go: {30.0: (*go.arm(), *go.auto())}, seconds=110.0
    ),
    "rebooted, and on from the next stop": Course(
        faults=("restart@16=3",), orders=lambda go: {30.0: (*go.jump("S3"), *go.arm(), *go.auto())}
    ),
    "rebooted for good": Course(faults=("restart@16=3",)),
}
LEFT_OPEN: dict[str, Truth] = {
    "shows a trigger of the scanner": "tried",
    "not show whether": "stood",
}
"""Words of a yes that leave open whether a scan succeeded, or was made."""
UNENDED = {
    name
    for name in COURSES
    if name.startswith(("given up", "another list", "rebooted for good", "switched off", "a jump of"))
}
"""Courses after which the vehicle stands in mid-mission, and may go on after the log."""
Kept = Callable[[int, str], bool]


def _gap(begin_s: float, seconds: float) -> Kept:
    return lambda ns, name: not begin_s <= ns % 10**12 / 1e9 < begin_s + seconds


def _without(*names: str) -> Kept:
    return lambda ns, name: name not in names


def _dropping(seed: int) -> Kept:
    chance = np.random.default_rng(seed)
    return lambda ns, name: name == "GPS_GLOBAL_ORIGIN" or bool(chance.random() > 0.3)


LOSSES: dict[str, tuple[Callable[[int], Kept], bool]] = {
    "all heard": (lambda seed: lambda ns, name: True, True),
    "a third lost": (_dropping, False),
    "no pictures": (lambda seed: _without("CAMERA_IMAGE_CAPTURED"), False),
    "no current item": (lambda seed: _without("MISSION_CURRENT", "MISSION_ITEM_REACHED"), False),
    "no attitude": (lambda seed: _without("ATTITUDE"), False),
    "a gap of 8 s": (lambda seed: _gap(6.0 + seed % 30, 8.0), False),
    "the end not heard": (lambda seed: _gap(15.0 + seed % 20, 1000.0), False),
}
"""What the station hears; True if an oracle could always tell."""


HIDDEN = ("a jump of the estimate", "a gap of 8 s")
"""A jump within a gap looks as if the vehicle had driven."""
SOURCES: dict[str, str] = {
    "AUTO tlog": "ardupilot", "AUTO BIN": "ardupilot", "AUTO PX4 tlog": "px4", "AUTO ulg": "px4"
}  # fmt: skip
"""Logs, and the autopilots that they are of."""


@dataclass(frozen=True)
class AutoAnswer:
    """Answer to a log of AUTO, with its truth."""

    source: str
    name: str
    truth: str
    answer: str
    could: bool
    text: str

    @property
    def kind(self) -> str:
        if self.answer in ("yes", "no"):
            return "right" if self.answer == self.truth else f"false {self.answer}"
        return "untold" if self.could else "open"


def auto_answers(folder: Path, every: int = 1, first: int = 0) -> Iterator[AutoAnswer]:
    """Yield the answer to each course with each loss, in every kind of log."""
    cases = [
        (source, course, loss)
        for source in SOURCES
        for course in COURSES
        for loss in LOSSES
        if (course, loss) != HIDDEN
    ]
    for number, (source, course, loss) in enumerate(cases):
        if number % every == first:
            yield auto_answer(source, course, loss, number, folder / str(number))


def auto_answer(source: str, course: str, loss: str, seed: int, folder: Path) -> AutoAnswer:
    """Drive a course, keep what is logged of it, and judge the log."""
    folder.mkdir()
    given, (loses, could) = COURSES[course], LOSSES[loss]
    autopilot, kept = SOURCES[source], loses(seed)
    plan = mission(tolerance_m=given.tolerance_m)
    shots, box = Shots(), BlackBox()

    def witness(vehicle: Vehicle) -> None:
        shots.watch(vehicle, least_stay_s(plan.stops[0]) - SHORTEST_S)
        box.watch(vehicle)

    orders = given.orders(Orders(plan, autopilot))
    rows = heard(
        folder, plan, autopilot=autopilot, faults=given.faults, orders=orders, witness=witness,
        seconds=given.seconds,
    )  # fmt: skip
    paths = _logs(source, folder, rows, box, kept)
    try:
        logs = [read_log(path) for path in paths]
        judged = drive_verdict(
            replay(logs[0], plan, Placing()) if len(logs) == 1 else replay_parts(logs, plan, Placing())
        )
        answer, text = judged.answer, judged.text
    except (InputError, Undecided) as error:
        answer, text = "refused", str(error)
    claim: Truth = "scanned"
    if answer == "yes":
        claim = next((truth for words, truth in LEFT_OPEN.items() if words in text), claim)
    truth = "yes" if shots.good(plan, claim) else "no"
    could = could and (truth == "yes" or course not in UNENDED)
    return AutoAnswer(source, f"{course} / {loss} #{seed}", truth, answer, could, text)


def _logs(source: str, folder: Path, rows: list[Any], box: BlackBox, kept: Kept) -> list[Path]:
    if source.endswith("tlog"):
        told = [row for row in rows if row[1] != ROVER or kept(row[0], row[2].get_type())]
        return [write_telemetry_log(folder / "auto.tlog", told)]
    boots = [boot for boot in box.boots if any(kept(ns, "LOCAL_POSITION_NED") for ns, _ in boot.poses)]
    if source == "AUTO BIN":
        return [dataflash_of(boot, folder / f"{k}.BIN", kept) for k, boot in enumerate(boots)]
    return [ulog_of(boot, folder / f"{k}.ulg", kept) for k, boot in enumerate(boots)]

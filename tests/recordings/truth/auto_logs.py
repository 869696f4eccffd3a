"""Telemetry logs of a simulated rover that drives a mission in AUTO, and of which the truth is known.

A witness on the vehicle writes down where it truly stood at each scan, and whether the scan succeeded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.bridge.mavlink.simulated.vehicle import Vehicle
from stopgo.mission.document import Mission, Stop
from stopgo.mission.errors import InputError, Undecided
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.translate import translate
from stopgo.recordings.replay.drive_verdict import drive_verdict
from tests.recordings.replay.test_followed_logs import (
    AUTO_MODE,
    HOLD_MODE,
    FromStation,
    command,
    in_mode,
    item_of,
    logged,
    mission,
    read_back,
    replayed,
)

FOREIGN = 250
WIDE_M, NARROW_M = 0.4, 0.05
"""A tolerance that the vehicle holds, and one that it does not."""
ARM = 400


@dataclass
class Shots:
    """Scans: where the vehicle truly stood when each ended, those that succeeded and all."""

    found: list[tuple[float, float]] = field(default_factory=list)
    tried: list[tuple[float, float]] = field(default_factory=list)

    def watch(self, vehicle: Vehicle) -> None:
        """See where the vehicle truly is at the end of each scan."""
        end = vehicle.camera.end

        def ended(now_ns: int, boot_ms: int) -> tuple[Any, str]:
            message, why = end(now_ns, boot_ms)
            pose = vehicle.rover.at(now_ns)[0]
            self.tried.append((pose.x, pose.y))
            if not why:
                self.found.append((pose.x, pose.y))
            return message, why

        vehicle.camera.end = ended  # type: ignore[method-assign]

    def good(self, plan: Mission, *, tried: bool) -> bool:
        """True if each stop has a scan within its tolerance; with `tried`, failed ones count."""
        made = self.tried if tried else self.found
        return all(
            any(math.dist(at, (stop.x, stop.y)) <= stop.tolerance_m for at in made) for stop in plan.stops
        )


@dataclass(frozen=True)
class Course:
    """Events of a run: faults of the vehicle, and orders by seconds from AUTO."""

    faults: tuple[str, ...] = ()
    orders: Callable[[Mission], dict[float, Any]] = lambda plan: {}
    tolerance_m: float = WIDE_M


def _upload(plan: Mission, system: int) -> tuple[FromStation, ...]:
    """The messages by which a station uploads a mission."""
    items = upload_of(translate(plan, "ardupilot", trigger="auto"))
    rows = [
        dialect.MAVLink_mission_item_int_message(
            1, 1, number, item.frame, item.command, 0, 1, *item.params, item.x, item.y, item.z
        )
        for number, item in enumerate(items)
    ]
    count = dialect.MAVLink_mission_count_message(1, 1, len(items))
    return tuple(FromStation(system, message) for message in (count, *rows))


def _beside(plan: Mission) -> Mission:
    """The same mission, all its stops 0.9 m aside."""

    def moved(stop: Stop) -> Stop:
        approach = tuple((x + 0.9, y) for x, y in stop.approach)
        return msgspec.structs.replace(stop, x=stop.x + 0.9, approach=approach)

    start = msgspec.structs.replace(plan.start, x=plan.start.x + 0.9)
    return msgspec.structs.replace(plan, start=start, stops=tuple(map(moved, plan.stops)))


def _jump(plan: Mission, stop: str) -> Any:
    return dialect.MAVLink_mission_set_current_message(1, 1, item_of(plan, stop))


COURSES: dict[str, Course] = {
    "as planned": Course(),
    "beside its stops": Course(tolerance_m=NARROW_M),
    "a stop jumped over": Course(orders=lambda plan: {0.5: _jump(plan, "S2")}),
    "two stops jumped over": Course(orders=lambda plan: {0.5: _jump(plan, "S3")}),
    "the last stop jumped over": Course(orders=lambda plan: {0.5: _jump(plan, "S3"), 3.0: _jump(plan, "S1")}),
    "held and sent on": Course(orders=lambda plan: {1.0: in_mode(HOLD_MODE), 20.0: in_mode(AUTO_MODE)}),
    "given up": Course(orders=lambda plan: {14.0: in_mode(HOLD_MODE)}),
    "given up at once": Course(orders=lambda plan: {2.0: in_mode(HOLD_MODE)}),
    "a scan failed": Course(faults=("scanner@2",)),
    "another list by a foreign station": Course(orders=lambda plan: {9.0: _upload(_beside(plan), FOREIGN)}),
    "another list before the first stop": Course(orders=lambda plan: {0.5: _upload(_beside(plan), FOREIGN)}),
    "another list, and ours again": Course(
        orders=lambda plan: {4.0: _upload(_beside(plan), FOREIGN), 6.0: _upload(plan, 255)}
    ),
    "our list by a foreign station": Course(orders=lambda plan: {9.0: _upload(plan, FOREIGN)}),
    "our list read back": Course(orders=lambda plan: {12.0: read_back(plan)}),
    "rebooted and sent on": Course(
        faults=("restart@16=3",), orders=lambda plan: {30.0: (command(ARM, 1), in_mode(AUTO_MODE))}
    ),
    "rebooted for good": Course(faults=("restart@16=3",)),
}
UNSEEN = "does not show whether a scan was made"
"""Words of a yes that rests on standstills: whether a scan succeeded, it leaves open."""
UNENDED = {name for name in COURSES if name.startswith(("given up", "another list", "rebooted for good"))}
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


@dataclass(frozen=True)
class AutoAnswer:
    """Answer to a log of AUTO, with its truth."""

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
    """Yield the answer to each course with each loss."""
    cases = [(course, loss) for course in COURSES for loss in LOSSES]
    for number, (course, loss) in enumerate(cases):
        if number % every == first:
            yield auto_answer(course, loss, number, folder / str(number))


def auto_answer(course: str, loss: str, seed: int, folder: Path) -> AutoAnswer:
    """Drive a course, keep what is heard of it, and judge the log."""
    folder.mkdir()
    given, (kept, could), shots = COURSES[course], LOSSES[loss], Shots()
    plan = mission(tolerance_m=given.tolerance_m)
    path = logged(
        folder / "auto.tlog", plan, faults=given.faults, orders=given.orders(plan), kept=kept(seed),
        witness=shots.watch,
    )  # fmt: skip
    try:
        judged = drive_verdict(replayed(path, plan))
        answer, text = judged.answer, judged.text
    except (InputError, Undecided) as error:
        answer, text = "refused", str(error)
    truth = "yes" if shots.good(plan, tried=answer == "yes" and UNSEEN in text) else "no"
    could = could and (truth == "yes" or course not in UNENDED)
    return AutoAnswer(f"{course} / {loss} #{seed}", truth, answer, could, text)

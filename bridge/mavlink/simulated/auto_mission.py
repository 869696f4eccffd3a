"""The mission of the simulated vehicle in AUTO, item by item.

A command that is no NAV command runs together with the start of the NAV command after it: at once, in order,
without waiting for anything. A NAV command takes its time and is then reported as reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from stopgo.bridge.mavlink.simulated.camera import Camera
from stopgo.bridge.mavlink.simulated.rover import Rover
from stopgo.bridge.mavlink.simulated.vehicle_faults import Mishaps
from stopgo.bridge.mavlink.simulated.vehicle_store import Store, StoredItems
from stopgo.mission.document import Point
from stopgo.mission.mavlink import recognise as recognised
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.items import Command, Item
from stopgo.mission.mavlink.recognise import TRIGGERS, WAITS

STAYS, HOMES = 17, 20
"""NAV_LOITER_UNLIM, NAV_RETURN_TO_LAUNCH."""
PLACES = recognised.PLACES | {STAYS}
NAV = PLACES | WAITS | {HOMES}
"""Commands that take time; every other one is done at once or skipped."""
AutoState = Literal["idle", "active", "complete"]
AutoPhase = Literal["driving", "holding", "waiting", "script", "lost", "rebooting", "stuck"]


@dataclass(frozen=True)
class AutoEvents:
    """Functions to call for each event of the mission, with the time in nanoseconds."""

    current: Callable[[int], None]
    reached: Callable[[int], None]
    trigger: Callable[[int, float, int], None]
    """A scan: the number in its item, its seconds (0: not given), and the time."""
    finished: Callable[[int], None]
    reboot: Callable[[], None]
    text: Callable[[str], None]


class AutoMission:
    """Progress of the vehicle in its mission, and the time of the next event."""

    def __init__(
        self,
        autopilot: Autopilot,
        store: Store,
        rover: Rover,
        camera: Camera,
        mishaps: Mishaps,
        events: AutoEvents,
    ) -> None:
        self._autopilot, self._store, self._rover = autopilot, store, rover
        self._camera, self._mishaps, self._events = camera, mishaps, events
        self._first = 1 if autopilot.home_first else 0
        self._phase: AutoPhase = "lost"
        self._item: Item | None = None
        self.state: AutoState = "idle"
        self.current = 0
        self.due_ns: int | None = None
        """Time of the next event; None while there is none."""

    @property
    def total(self) -> int:
        """Items without home."""
        return max(0, len(self._store.stored.mission) - self._first)

    def go_on(self, now_ns: int) -> None:
        """Begin, or go on with the current item; a finished mission begins again."""
        number = self._first if self.state == "complete" else max(self.current, self._first)
        self._go(number, now_ns)

    def pause(self, now_ns: int) -> None:
        """Pause; the item stays the current one."""
        if self.state == "active":
            self.state = "idle"
            self._rover.brake(now_ns)
        self.due_ns = None

    def reset(self) -> None:
        self.state, self.current, self.due_ns = "idle", 0, None

    def jump(self, number: int, now_ns: int) -> bool:
        """Make an item the current one; false if there is none of that number."""
        if not 0 <= number < len(self._store.stored.mission):
            return False
        active = self.state == "active"
        self.state, self.current = "idle", number
        self._events.current(number)
        if active:
            self._go(max(number, self._first), now_ns)
        return True

    def replaced(self, marked: int | None, now_ns: int) -> None:
        """Go on with another list, or with none."""
        keeps = self._autopilot.behaviour.restarts_item and self.current < len(self._store.stored.mission)
        number = self.current if keeps else (marked or 0)
        active, self.state = self.state == "active", "idle"
        self.current = number
        if active and self.total:
            self._go(max(number, self._first), now_ns)
        elif active:
            self.due_ns = None
            self._rover.brake(now_ns)

    def step(self) -> None:
        """Bring about the event that is due."""
        assert self.due_ns is not None
        now_ns, self.due_ns = self.due_ns, None
        if self._phase == "rebooting":
            self._events.reboot()
        elif self._phase == "stuck" and self._item is not None:
            self._drive(self._item, now_ns)
        elif self._phase == "driving" and (again_ns := self._rover.arrival_ns(now_ns)) is not None:
            self.due_ns = again_ns
        elif self._phase == "driving" and (hold_s := self._hold_s()) > 0:
            self._phase, self.due_ns = "holding", now_ns + _ns(hold_s)
        elif self._phase == "driving" and self._item and self._item.command == STAYS:
            return  # stays there until another command
        else:
            self._events.reached(self.current)
            self._go(self.current + 1, now_ns)

    def scan_over(self, now_ns: int) -> None:
        """Go on after the scan that a script waits for."""
        if self.state == "active" and self._phase == "script":
            self.due_ns = now_ns

    def _go(self, number: int, now_ns: int) -> None:
        """Execute the items that take no time, and begin the first one that takes time."""
        items = self._store.stored.mission
        self.state = "active"
        while number < len(items):
            if items[number].command in NAV:
                self.current, self._item = number, items[number]
                self._events.current(number)
                return self._begin(items[number], now_ns)
            self._act(items, number, now_ns)
            number += 1
        self.state, self.due_ns = "complete", None
        self._rover.brake(now_ns)
        self._events.finished(now_ns)

    def _act(self, items: StoredItems, number: int, now_ns: int) -> None:
        item = items[number]
        if item.command == Command.DO_CHANGE_SPEED:
            self._rover.set_speed(item.params[1])
        elif item.command in TRIGGERS:
            self._events.trigger(*_scan_of(items, number), now_ns)

    def _begin(self, item: Item, now_ns: int) -> None:
        if item.command in PLACES or item.command == HOMES:
            self._drive(item, now_ns)
            return
        self._rover.brake(now_ns)
        if item.command == Command.NAV_DELAY:
            self._phase, self.due_ns = "waiting", now_ns + _ns(item.params[0])
        else:
            self._phase = "script"
            self.due_ns = now_ns + _ns(item.params[1]) if item.params[1] else None
            if self._camera.under_way is None:
                self._events.trigger(max(0, item.x), item.params[2], now_ns)

    def _drive(self, item: Item, now_ns: int) -> None:
        to = self._rover.point(item.x, item.y) if item.command in PLACES else (0.0, 0.0)
        if to is None:
            self._phase, self.due_ns = "lost", None
            why = "no global origin" if self._rover.origin is None else "too far away"
            return self._events.text(f"Item {self.current}: {why}")
        if stuck := self._mishaps.once("stuck", self.current):
            self._phase, self.due_ns = "stuck", now_ns + _ns(stuck.amount) if stuck.amount else None
            return self._rover.brake(now_ns)
        finish = self._mishaps.due("finish", self.current)
        to_spare, heading = (finish.amount or 1.0, None) if finish else (0.0, self._heading(item))
        ends_ns = self._rover.drive(
            self._shifted(to, now_ns), now_ns, heading=heading, to_spare=to_spare, keeps=True
        )
        self._phase, self.due_ns = "driving", ends_ns
        if self._mishaps.once("reboot-mission", self.current):
            here = self._rover.at(now_ns)[0]
            half_ns = round(math.dist(to, (here.x, here.y)) / self._rover.speed / 2 * 1e9)
            self._phase, self.due_ns = "rebooting", max(now_ns + half_ns, (now_ns + ends_ns) // 2)

    def _shifted(self, to: Point, now_ns: int) -> Point:
        fault = self._mishaps.due("beside", self.current)
        if not fault:
            return to
        here = self._rover.at(now_ns)[0]
        left = math.atan2(to[1] - here.y, to[0] - here.x) + math.pi / 2
        return to[0] + fault.amount * math.cos(left), to[1] + fault.amount * math.sin(left)

    def _heading(self, item: Item) -> float | None:
        """Heading counter-clockwise from east, if the item gives one and the vehicle turns to it."""
        yaw = item.params[3]
        turns = self._autopilot.turns and item.command == Command.NAV_WAYPOINT
        return math.pi / 2 - math.radians(yaw) if turns and math.isfinite(yaw) else None

    def _hold_s(self) -> float:
        item = self._item
        if item is None or item.command not in (Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME):
            return 0.0
        if self._mishaps.due("finish", self.current):
            return 0.0
        hold = item.params[0]
        return 0.0 if hold > self._autopilot.longest_hold_s else hold


def _scan_of(items: StoredItems, number: int) -> tuple[int, float]:
    """Number in a trigger, and the seconds that its scan takes (0: not given).

    A script message has them in param3. A camera command has no field for them: param2, the interval, counts
    if it is not 0, else the wait that comes next.
    """
    item = items[number]
    if item.command == Command.DO_SEND_SCRIPT_MESSAGE:
        return _number(item.params[1]), item.params[2]
    carried = _number(item.params[3]) if item.command == Command.IMAGE_START_CAPTURE else 0
    given = item.params[1] if item.command == Command.IMAGE_START_CAPTURE else 0.0
    after = items[number + 1] if number + 1 < len(items) else None
    waits = after is not None and after.command == Command.NAV_DELAY
    return carried, given if given > 0 else (after.params[0] if after and waits else 0.0)


def _number(value: float) -> int:
    return int(value) if math.isfinite(value) and 0 <= value < 2**31 else 0


def _ns(seconds: float) -> int:
    """Nanoseconds, never negative, and never so long that they overflow."""
    return round(min(seconds, 1e9) * 1e9) if seconds > 0 else 0

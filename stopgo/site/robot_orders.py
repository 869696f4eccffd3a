"""Orders of pages to robots: sent at once over the open links, and shown until the robot stands.

A stop goes to every robot that it names, whatever state the site believes in. It has threads of its own, so
nothing else delays it. What became known is shown with its time; what did not is shown as unknown. A pause
without an answer is sent again by other threads, until the robot answers.
"""

from __future__ import annotations

import threading
import time
import uuid
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, Literal

import msgspec

from stopgo.bridge.mavlink.auto.open_vehicle import OpenVehicle
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, StopgoError
from stopgo.mission.mavlink.telemetry import STILL_M_S
from stopgo.mission.run.run_commands import Verb
from stopgo.site.event_feed import EventFeed
from stopgo.site.live_robot import LiveRobot

MOST_KEPT = 200
STOP_THREADS, ORDER_THREADS = 64, 16
WATCHED_S = 30.0
"""Time for which a stop is watched until the robot stands."""
REPEATED_S = 600.0
"""Time for which a pause without an answer is sent again."""
AGAIN_S = 0.5
"""Pause before it is sent again."""
DRIVING = ("RUNNING", "HOMING")

OrderOutcome = Literal["sent", "ok", "refused", "unknown", "not_sent"]


class StopRequest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A press of STOP; without names, for every robot."""

    id: str
    robots: tuple[str, ...] = ()


class OrderRequest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An order to one robot; sent again with the same `id`, it is given once.

    The robot refuses it if it has another mission, run or stop than the page showed: another page may have
    ordered meanwhile.
    """

    id: str
    verb: Verb
    mission_id: str | None = None
    revision: int | None = None
    run_id: str | None = None
    stop: str | None = None
    take_over: bool = False
    again: bool = False
    from_here: bool = False


class PushRequest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A mission file of the folder for one robot.

    It is not sent if the page showed another mission in the file or at the robot: another page may have saved
    or pushed one meanwhile.
    """

    id: str
    file: str
    digest: str | None = None
    """Digest of the mission that the page showed in the file."""
    held: str | None = None
    """Digest of the mission that the page showed at the robot; empty if it showed none."""
    take_over: bool = False


@dataclass(frozen=True)
class OrderRecord:
    """An order and what is known of it; times are seconds since 1970 on this machine's clock."""

    id: str
    robot: str
    verb: str
    sent_at: float
    outcome: OrderOutcome = "sent"
    heard_at: float | None = None
    """Time of the robot's answer."""
    standing_at: float | None = None
    """Time of the first report after a stop in which the robot stands."""
    reason: str = ""
    message: str = ""
    state: str = ""
    repeated: bool = False
    """True while a pause without an answer is sent again."""


@dataclass(frozen=True)
class UnansweredPause:
    """A pause that is sent again until the robot answers; it has one command id, so it takes effect once."""

    robot: LiveRobot
    record: OrderRecord
    cmd_id: str
    until_s: float
    """Time on the monotonic clock at which it is given up."""


class RobotOrders:
    """Orders to the robots of a site."""

    def __init__(self, robots: Mapping[str, LiveRobot], feed: EventFeed) -> None:
        self._robots = robots
        self._feed = feed
        self._lock = threading.Lock()
        self._given: OrderedDict[tuple[str, str], Future[OrderRecord]] = OrderedDict()
        self._stops = ThreadPoolExecutor(STOP_THREADS, "stop")
        self._others = ThreadPoolExecutor(ORDER_THREADS, "order")
        self._watched: dict[str, tuple[OrderRecord, float]] = {}
        """Stops whose robot is not known to stand, and when each was sent on the monotonic clock."""
        self._repeats = ThreadPoolExecutor(STOP_THREADS, "repeat")
        self._unanswered: dict[str, str] = {}
        """Id of each robot's newest pause, until it is answered or the robot obeys another order."""
        self._closed = threading.Event()

    def close(self) -> None:
        """Give no more orders; those on their way are waited for by nobody."""
        self._closed.set()
        self._stops.shutdown(wait=False, cancel_futures=True)
        self._repeats.shutdown(wait=False, cancel_futures=True)
        self._others.shutdown(wait=False, cancel_futures=True)

    def stop(self, request: StopRequest) -> list[Future[OrderRecord]]:
        """Send a pause to robots, all at the same time."""
        names = request.robots or tuple(self._robots)
        return [
            self._once(request.id, name, partial(self._stop, request.id, self.robot(name)), self._stops)
            for name in names
        ]

    def order(self, name: str, request: OrderRequest) -> Future[OrderRecord]:
        """Send an order to one robot."""
        robot = self.robot(name)
        if request.verb in ("pause", "abort"):
            return self._once(
                request.id, name, partial(self._stop, request.id, robot, request.verb), self._stops
            )
        give = partial(robot.station.command, request.verb, **_details(request))
        return self._once(
            request.id, name, partial(self._run, request.id, robot, request.verb, give), self._others
        )

    def push(self, name: str, request: PushRequest, mission: Mission) -> Future[OrderRecord]:
        """Send a mission to one robot, and verify that it is stored."""
        robot = self.robot(name)
        give = partial(_push_as_shown, robot, request, mission)
        return self._once(request.id, name, partial(self._run, request.id, robot, "push", give), self._others)

    def robot(self, name: str) -> LiveRobot:
        """Return a robot by name; raises `InputError` if the site has none of this name."""
        found = self._robots.get(name)
        if found is None:
            raise InputError(f"robot {name[:64]!r}: not on this site")
        return found

    def _once(
        self, order_id: str, name: str, work: Callable[[], OrderRecord], pool: ThreadPoolExecutor
    ) -> Future[OrderRecord]:
        """Begin an order, or return the one that was begun under its id."""
        with self._lock:
            known = self._given.get((order_id, name))
            if known is not None:
                return known
            begun = self._given[order_id, name] = pool.submit(work)
            while len(self._given) > MOST_KEPT:
                self._given.popitem(last=False)
        return begun

    def _stop(self, order_id: str, robot: LiveRobot, verb: Verb = "pause") -> OrderRecord:
        sent_s = time.monotonic()
        station = robot.station
        sent = OrderRecord(order_id, robot.name, verb, time.time())
        # A vehicle in AUTO has no command ids: sent again, HOLD would end what a pilot does meanwhile.
        cmd_id = uuid.uuid4().hex if verb == "pause" and not isinstance(station, OpenVehicle) else ""
        with self._lock:
            self._watched[robot.name] = (sent, sent_s)
            if cmd_id:
                self._unanswered[robot.name] = order_id
        robot.on_change = partial(self.look_if_standing, robot)
        heard_at: list[float] = []

        def heard() -> None:
            heard_at.append(time.time())
            self._tell(replace(sent, heard_at=heard_at[0]))

        give = partial(station.command, verb, **({"cmd_id": cmd_id} if cmd_id else {}))
        with station.hearing(heard):
            done = self._run(order_id, robot, verb, give, sent=sent)
        if heard_at:
            done = replace(done, heard_at=heard_at[0])
            self._tell(done)
        if cmd_id:
            done = self._repeat_until_answered(robot, done, cmd_id, sent_s)
        with self._lock:
            watched = self._watched.get(robot.name)
            if watched is not None and watched[0].id == order_id:
                self._watched[robot.name] = (done, sent_s)
        self.look_if_standing(robot)
        return done

    def _repeat_until_answered(
        self, robot: LiveRobot, done: OrderRecord, cmd_id: str, sent_s: float
    ) -> OrderRecord:
        """Begin to send a pause again if it was not answered; return its record, which says so."""
        with self._lock:
            if self._unanswered.get(robot.name) != done.id:
                return done
            if done.heard_at is not None or self._closed.is_set():
                del self._unanswered[robot.name]
                return done
        done = replace(done, repeated=True)
        self._tell(done)
        self._send_later(UnansweredPause(robot, done, cmd_id, sent_s + REPEATED_S))
        return done

    def _send_later(self, pause: UnansweredPause) -> None:
        with suppress(RuntimeError):  # the site is closed meanwhile
            self._repeats.submit(self._send_again, pause)

    def _send_again(self, pause: UnansweredPause) -> None:
        """Send a pause again; without an answer once more, after those of other robots."""
        robot, record = pause.robot, pause.record
        self._closed.wait(AGAIN_S)
        sent_s = time.monotonic()
        if self._closed.is_set() or not self._is_wanted(pause, sent_s):
            return
        give = partial(robot.station.command, "pause", cmd_id=pause.cmd_id)
        record = _outcome(record, give)
        if record.heard_at is None:
            if record.outcome != pause.record.outcome == "not_sent":  # now it may have been sent
                self._tell(self._with_standing(record))
            else:
                record = pause.record
            self._send_later(replace(pause, record=record))
            return
        record = replace(record, repeated=False)
        with self._lock:
            if self._unanswered.get(robot.name) != record.id:
                return
            del self._unanswered[robot.name]
            self._watched[robot.name] = (record, sent_s)
        self._tell(self._with_standing(record))
        self.look_if_standing(robot)

    def _is_wanted(self, pause: UnansweredPause, now_s: float) -> bool:
        """Return False, and show it, if a pause is not to be sent again."""
        name = pause.robot.name
        with self._lock:
            newest = self._unanswered.get(name)
            if newest == pause.record.id and now_s < pause.until_s:
                return True
            if newest == pause.record.id:
                del self._unanswered[name]
        if newest in (pause.record.id, None):
            self._tell(self._with_standing(replace(pause.record, repeated=False)))
        return False

    def _with_standing(self, record: OrderRecord) -> OrderRecord:
        """Return a record with the time at which the robot was seen to stand, if the page shows one."""
        shown = self._feed.value("stop", record.robot)
        if shown is None or shown["id"] != record.id:
            return record
        return replace(record, standing_at=shown["standing_at"])

    def _run(
        self,
        order_id: str,
        robot: LiveRobot,
        verb: str,
        give: Callable[[], Any],
        *,
        sent: OrderRecord | None = None,
    ) -> OrderRecord:
        """Give an order, and show it when it is sent and when its outcome is known."""
        record = sent or OrderRecord(order_id, robot.name, verb, time.time())
        self._tell(record)
        record = _outcome(record, give)
        if verb != "pause" and record.outcome == "ok":  # the robot obeys the newer order
            with self._lock:
                self._unanswered.pop(robot.name, None)
        self._tell(record)
        return record

    def look_if_standing(self, robot: LiveRobot) -> None:
        """Show that a stopped robot stands, once reports that came after the stop say so."""
        with self._lock:
            watched = self._watched.get(robot.name)
            if watched is None:
                return
            record, sent_s = watched
            if time.monotonic() - sent_s > WATCHED_S:
                del self._watched[robot.name]
                return
            if record.outcome == "sent" or not _stands(robot, sent_s):
                return
            del self._watched[robot.name]
        self._tell(replace(record, standing_at=time.time()))

    def _tell(self, record: OrderRecord) -> None:
        kind = "stop" if record.verb in ("pause", "abort") else "order"
        self._feed.tell((kind, record.robot), asdict(record), at_once=True)


def _push_as_shown(robot: LiveRobot, request: PushRequest, mission: Mission) -> Any:
    """Push a mission; raises `InputError` if that would change anything else than the page showed."""
    if request.digest not in (None, mission.digest):
        raise InputError(f"{request.file}: changed after the page showed the difference; look at it again")
    held = robot.held
    if held.is_known and request.held not in (None, held.digest):
        raise InputError(
            f"{robot.name} got another mission after the page showed the difference; look at it again"
        )
    return robot.station.push(mission, take_over=request.take_over)


def _outcome(record: OrderRecord, give: Callable[[], Any]) -> OrderRecord:
    """Give an order, and return its record with what became known."""
    try:
        answer = give()
    except StopgoError as error:
        return replace(record, **_failure(error))
    state, message = str(getattr(answer, "state", "")), str(getattr(answer, "message", ""))
    return replace(record, outcome="ok", heard_at=time.time(), state=state, message=message)


def _details(request: OrderRequest) -> dict[str, Any]:
    """Return the fields of the command that the station does not fill in itself."""
    if request.verb == "start":
        return {
            "take_over": request.take_over, "again": request.again, "from_here": request.from_here,
            "mission_id": request.mission_id, "revision": request.revision,
        }  # fmt: skip
    stop = request.stop if request.verb in ("skip", "retry") else None
    return {"take_over": request.take_over, "run_id": request.run_id, "stop": stop}


def _stands(robot: LiveRobot, since_s: float) -> bool:
    """Return True if a state and a pose that arrived since then say that the robot does not drive."""
    state, pose = robot.state, robot.pose
    if state is None or pose is None or min(robot.state_at, robot.pose_at) <= since_s:
        return False
    return state.state not in DRIVING and abs(pose.speed) < STILL_M_S


def _failure(error: StopgoError) -> dict[str, Any]:
    """Return the outcome of an order that was not carried out, or may not have been."""
    if isinstance(error, NegativeResult):
        outcome: OrderOutcome = "refused"
        heard = time.time()
        return {"outcome": outcome, "heard_at": heard, "reason": error.reason or "", "message": str(error)}
    outcome = "unknown" if isinstance(error, OutcomeUnknown) else "not_sent"
    return {"outcome": outcome, "message": str(error)}


def records_json(records: Iterable[OrderRecord]) -> list[dict[str, Any]]:
    """Return records for the page."""
    return [asdict(record) for record in records]

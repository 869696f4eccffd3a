"""One robot as pages show it: its state with its age, events, path and coverage, from any kind of link.

Data. Poses and events go from the link's threads to the feed at once. Everything else goes through the
robot's own thread, which follows run after run as `stopgo watch` does, and records each in the folder.

Invariants:
- A state on the feed is the newest by the robot's sealed sequence; its age is never understated.
- What was reported live is read again from the robot's journal, so that nothing is missing (`ShownRun`).
"""

from __future__ import annotations

import math
import queue
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import msgspec

from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.protocol import decode
from stopgo.bridge.mavlink.auto.open_vehicle import NOT_IN_AUTO, OpenVehicle
from stopgo.bridge.station.follow import (
    AGAIN_S,
    SILENCE_S,
    Followed,
    LiveReport,
    RunFollower,
    Silence,
    WatchedLink,
    late_poses,
    next_report,
    subscribe,
)
from stopgo.bridge.station.logged_run import LoggedReport
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import StopgoError
from stopgo.mission.run.events import (
    PoseReport,
    PosesMissing,
    ReportsMissing,
    Scanned,
    Skipped,
    StateReport,
    Unconfirmed,
    event_of,
)
from stopgo.site.event_feed import EventFeed
from stopgo.site.known_missions import KnownMission, KnownMissions
from stopgo.site.run_recording import OpenRecording, RunRecording
from stopgo.site.shown_run import ShownRun

NO_RUN = ("IDLE", "READY")
"""States of a robot that has begun no run of its mission."""


@dataclass(frozen=True)
class HeldMission:
    """The mission that a robot holds by its newest state."""

    is_known: bool
    mission: Mission | None = None

    @property
    def digest(self) -> str:
        """Digest of the mission; empty if the robot holds none, or it is not known."""
        return "" if self.mission is None else self.mission.digest


class LiveRobot:
    """A robot that is followed run after run; `follow` is the work of its thread."""

    def __init__(
        self, station: Station, feed: EventFeed, missions: KnownMissions, recorder: OpenRecording
    ) -> None:
        self.station = station
        self.name = station.keys.robot
        self.state: StateReport | None = None
        self.state_at = self.pose_at = 0.0
        """Times at which the newest state and the newest pose arrived."""
        self.pose: PoseReport | None = None
        self.mission: Mission | None = None
        """Mission that the robot holds, once it was read."""
        self._plan_reader: threading.Thread | None = None
        self.on_change: Callable[[], None] = lambda: None
        """Called after each state and pose, from several threads."""
        self._feed = feed
        self._missions = missions
        self._recording = RunRecording(self.name, feed, recorder, station.mission)
        self._shown = ShownRun(feed, self.name)
        self._true_at = time.monotonic()
        """Time at which the newest state was true, at the latest known."""
        self._token = uuid.uuid4().hex[:12]
        self._trouble: tuple[str, ...] = ("not_found",)
        self._reason = ""
        self._offset: tuple[str, float] = ("", -math.inf)
        """Boot, and lower bound of this clock minus the robot's, seconds."""
        self._stops: dict[str, str] = {}
        self._coverage_lock = threading.Lock()
        """Held from reading the stops until their coverage is shown, so that the newest is shown last."""
        self._run_id = ""
        """Run that is followed and recorded."""

    def work(self, stopped: threading.Event) -> None:
        """Follow the robot until `stopped`; a fault that ends this is shown, and STOP works all the same."""
        try:
            self.follow(stopped)
        except Exception as error:  # noqa: BLE001  where the robot's thread ends
            if not stopped.is_set():
                self._set_fault(error)

    def _set_fault(self, error: Exception) -> None:
        name = type(error).__name__
        self._set_trouble((f"unexpected error ({name}: {error}); restart stopgo site, and report it",))

    def follow(self, stopped: threading.Event) -> None:
        """Follow the robot until `stopped`; the fault of one run does not end it."""
        link, keys = self.station.link, self.station.keys
        self._tell_state(time.monotonic())
        received = subscribe(link, keys)
        link.hear(keys.pose, lambda key, payload: self._hear_pose(payload))
        link.hear(keys.event, lambda key, payload: self._hear_event(payload))
        link.announce(keys.watcher(self._token))
        watched = WatchedLink(self._keep)
        while not stopped.is_set():
            try:
                self._follow_run(received, watched, stopped)
            except StopgoError as error:
                self._set_trouble((str(error),))
                stopped.wait(SILENCE_S)
            finally:
                self._recording.close()

    def _follow_run(
        self, received: queue.SimpleQueue[LiveReport], watched: WatchedLink, stopped: threading.Event
    ) -> None:
        """Follow one run to its end, and wait for the next; without one, the robot's states."""
        link, keys = self.station.link, self.station.keys
        follower = RunFollower(link, keys, lambda: RECORD in self.station.capabilities)
        first = self._newest(watched.ask())
        for report in () if first is None else follower.take(first):
            self._take(report)
        while not stopped.is_set():
            item = next_report(received, 0.0 if follower.poses.behind else AGAIN_S)
            silent_s = watched.take(item)
            if item is None and silent_s >= SILENCE_S:
                self._take(Silence(seconds=silent_s))
            asked = self._newest(watched.ask()) if watched.to_ask else None
            news = self._newest(item) if watched.is_news else None
            if _is_of_next_run(follower, news) or _is_of_next_run(follower, asked):
                return
            for fresh in (asked, news):
                for report in () if fresh is None or follower.ended else follower.take(fresh):
                    self._take(report)
            if follower.ended and self._recording.is_open:
                for report in late_poses(received, follower):
                    self._take(report)
                self._recording.close()
            elif not follower.ended:
                self._catch_up(follower, watched, idle=item is None)

    def _catch_up(self, follower: RunFollower, watched: WatchedLink, *, idle: bool) -> None:
        """Take what is missing of the run; poses when nothing else waits."""
        for pose in follower.poses.catch_up() if idle and follower.poses.behind else ():
            self._take(pose)
        for report in follower.catch_up():
            self._take(report)
        for missing in watched.missing(follower):
            self._take(missing)

    def _keep(self) -> StateReport | None:
        asked_at = time.monotonic()
        state = self.station.keep(self._token)
        if state is not None:
            boot, offset = self._offset
            newest = asked_at - state.robot_ns / 1e9
            self._offset = (state.boot_id, max(offset, newest) if boot == state.boot_id else newest)
        return state

    def _newest(self, item: LiveReport | None) -> LiveReport | None:
        """Show a state as soon as it is there, before the events that it counts."""
        if isinstance(item, StateReport):
            before, self.state, self._trouble = self.state, item, ()
            self.state_at = now = time.monotonic()
            boot, offset = self._offset
            known = boot == item.boot_id and math.isfinite(offset)
            self._tell_state(min(now, item.robot_ns / 1e9 + offset) if known else now)
            self._read_mission(item)
            if before is not None and (before.state in NO_RUN) != (item.state in NO_RUN):
                self._tell_coverage()
            self.on_change()
        return item

    def _hear_pose(self, payload: bytes) -> None:
        """Show a pose at once; called by the link's threads."""
        try:
            report = decode(payload, PoseReport)
        except msgspec.DecodeError:
            return
        self.pose, self.pose_at = report, time.monotonic()
        pose = {"x": round(report.pose.x, 3), "y": round(report.pose.y, 3), "heading": report.pose.heading}
        self._feed.tell(("pose", self.name), pose | {"speed": round(report.speed, 3)})
        self.on_change()

    def _hear_event(self, payload: bytes) -> None:
        """Show an event at once, before it is read from the robot's journal; called by the link's threads."""
        with suppress(msgspec.DecodeError):
            self._shown.take_live(event_of(payload), self.pose)

    def _tell_state(self, at_s: float) -> None:
        state, lease = self.state, self.station.lease
        value: dict[str, Any] = {} if state is None else msgspec.to_builtins(state)
        value["robot"] = self.name
        value["battery"] = None if state is None else state.charge
        value["trouble"] = self._trouble
        value["vehicle"] = _vehicle_json(self.station)
        value["lease"] = None
        if lease is not None:
            value["lease"] = {"holder": lease.commander, "left_s": self.station.lease_left_s}
        self._feed.tell(("robot", self.name), value, at_s=at_s)
        self._true_at = at_s

    def show_trouble(self, trouble: str) -> None:
        """Show why nothing is received; from another thread."""
        self._reason = trouble
        if trouble:
            self._set_trouble((trouble,))

    def _set_trouble(self, trouble: tuple[str, ...]) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._tell_state(self._true_at)

    def _read_mission(self, state: StateReport) -> None:
        """Read the mission that the robot holds, when it changes; its plan by another thread.

        A plan takes seconds to read. In that time states go on, and a stop is shown as standing.
        """
        held = self.mission
        if state.mission_id is None or state.revision is None:
            return
        if held is not None and (held.id, held.revision) == (state.mission_id, state.revision):
            return
        self.mission = self.station.mission(state.mission_id, state.revision)
        self._plan_reader = threading.Thread(target=self._read_plan, daemon=True)
        self._plan_reader.start()

    @property
    def held(self) -> HeldMission:
        """Mission that the robot holds; unknown before its first state, and until a new mission was read."""
        state, mission = self.state, self.mission
        if state is None:
            return HeldMission(is_known=False)
        if state.mission_id is None:
            return HeldMission(is_known=True)
        is_read = mission is not None and (mission.id, mission.revision) == (state.mission_id, state.revision)
        return HeldMission(is_known=is_read, mission=mission if is_read else None)

    def _read_plan(self) -> None:
        try:
            self._tell_mission()
        except Exception as error:  # noqa: BLE001  where a thread ends
            self._set_fault(error)

    def _tell_mission(self) -> None:
        held = self.mission
        if held is None:
            return
        known = self._missions.add(held)
        if held is not self.mission:  # the robot holds another one meanwhile, which is told by itself
            return
        mission = known.mission
        value = {
            "id": mission.id, "revision": mission.revision, "name": mission.name, "stops": len(mission.stops),
            "total_s": schedule(mission).total_s, "trouble": known.trouble,
        }  # fmt: skip
        self._feed.tell(("mission", self.name), value)
        self._tell_coverage()

    def look_again(self) -> None:
        """Look for the plan of the robot's mission again: a new one may be in the folder."""
        self._tell_mission()

    def _take(self, report: Followed) -> None:
        """Show and record one report of the run."""
        self._begin_run(report)
        if isinstance(report, Silence):
            self._set_trouble((self._reason or "silent",))
        elif isinstance(report, ReportsMissing):
            self._set_trouble(report.topics)
        elif isinstance(report, PoseReport):
            self._shown.add_pose(report)
        elif not isinstance(report, StateReport | PosesMissing | LoggedReport):
            self._tell_event(report)
        self._recording.take(report)

    def _begin_run(self, report: Followed) -> None:
        run_id = getattr(report, "run_id", None)
        if not run_id or run_id == self._run_id or isinstance(report, ReportsMissing):
            return
        self._run_id, self._stops = run_id, {}
        self._shown.begin(run_id)
        self._recording.begin(run_id, self._plan_reader, self._known)
        self._tell_coverage()

    def _tell_event(self, event: Any) -> None:
        self._shown.take(event, self.pose)
        if isinstance(event, Scanned | Unconfirmed | Skipped):
            self._stops[event.stop] = "skipped" if isinstance(event, Skipped) else "done"
            self._tell_coverage()

    def _tell_coverage(self) -> None:
        with self._coverage_lock:
            self._tell_coverage_now()

    def _tell_coverage_now(self) -> None:
        known = self._known()
        stops = dict(self._stops) if self._is_of_its_run else {}  # another thread may add one
        done, skipped = (
            tuple(stop for stop, what in stops.items() if what == kind) for kind in ("done", "skipped")
        )
        value = None if known is None else known.coverage(done, skipped)
        shown = {"run": self._run_id, "done": done, "skipped": skipped, "coverage": value}
        self._feed.tell(("coverage", self.name), shown)

    @property
    def _is_of_its_run(self) -> bool:
        """False while the robot has no run, or another than the one whose stops are known."""
        state = self.state
        return state is None or (state.state not in NO_RUN and state.run_id == self._run_id)

    def _known(self) -> KnownMission | None:
        """Return the mission that the robot holds, with its plan if that is known."""
        mission = self.mission
        return None if mission is None else self._missions.get(mission.id, mission.revision)


def _vehicle_json(station: Station) -> dict[str, Any] | None:
    """Return the address of a vehicle that drives its own list, and what is not possible there."""
    if not isinstance(station, OpenVehicle):
        return None
    return {"url": str(station.url), "cannot": sorted(NOT_IN_AUTO)}


def _is_of_next_run(follower: RunFollower, item: LiveReport | None) -> bool:
    """True for a state of another run than the one that is followed."""
    if not isinstance(item, StateReport) or follower.run_id is None:
        return False
    return item.run_id != follower.run_id

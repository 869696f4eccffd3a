"""State of a vehicle at each moment, collected from its messages."""

from __future__ import annotations

from stopgo.mission.mavlink.autopilots.kind import AUTO, Autopilot
from stopgo.mission.mavlink.captures import Capture, Picture, capture_of
from stopgo.mission.mavlink.following.capture_reports import CaptureReport, CaptureReports, scan_pose
from stopgo.mission.mavlink.following.list_position import ListPosition
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.progress_watch import ProgressWatch
from stopgo.mission.mavlink.following.scan_watch import ScanWatch
from stopgo.mission.mavlink.following.steps import Observation
from stopgo.mission.mavlink.following.vehicle_poses import VehiclePoses
from stopgo.mission.mavlink.following.vehicle_status import VehicleStatus
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.events import Arrived, Pose
from stopgo.mission.run.states import Run

USED_MESSAGES = (
    "HEARTBEAT", "MISSION_CURRENT", "MISSION_ITEM_REACHED", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
    "ATTITUDE", "SYS_STATUS", "BATTERY_STATUS",
    "EKF_STATUS_REPORT", "ESTIMATOR_STATUS", "FENCE_STATUS", "CAMERA_IMAGE_CAPTURED", "GPS_GLOBAL_ORIGIN",
    "SYSTEM_TIME", "STATUSTEXT",
)  # fmt: skip
"""Messages that are used."""
WANTED = ("MISSION_CURRENT", "LOCAL_POSITION_NED", "ATTITUDE")
"""The most important ones."""
NONE_YET: Picture = (-1, -1)


class Observer:
    """Takes messages one after another; returns the state on request."""

    def __init__(self, autopilot: Autopilot) -> None:
        self.status = VehicleStatus(autopilot)
        self.position = ListPosition()
        self.poses = VehiclePoses()
        self.captures = CaptureReports()
        self.progress = ProgressWatch()
        self._scan_watch = ScanWatch()
        self._came_ns: dict[str, int] = {}
        """Time of the last message of each name."""

    def take(self, message: Message, listed: ListedMission | None, now_ns: int) -> str:
        """Store a message; return its name."""
        name = str(message.get_type())
        self._came_ns[name] = now_ns
        self.status.take(name, message, now_ns)
        fix = self.poses.take(name, message, listed, now_ns)
        if fix is not None:
            self._scan_watch.take_pose(fix.pose, fix.speed)
            self._note_progress(fix.pose, listed)
        if name == "MISSION_CURRENT":
            self._take_current(message, listed, now_ns)
        elif name == "MISSION_ITEM_REACHED":
            self.position.take_reached(message)
        elif name == "CAMERA_IMAGE_CAPTURED":
            capture = capture_of(message, None if listed is None else listed.sent)
            at_stop = self.position.is_at_stop(listed)
            if self.captures.is_new(capture) and not self._scan_watch.take_report(now_ns):
                return self._ignored(capture, name)
            self.captures.take(capture, self.poses.pose(now_ns), now_ns, at_stop=at_stop)
        return name

    def _ignored(self, capture: Capture, name: str) -> str:
        """Ignore the report of an older scan, also when it is repeated."""
        self.captures.ignore(capture)
        return name

    def _take_current(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        boot_ms = self.status.boot_ms
        same = self.position.take_current(message, listed, boot_ms=boot_ms, now_ns=now_ns)
        if listed is not None:
            self._scan_watch.take_item(listed, self.position.place(listed), now_ns, same=same)

    def _note_progress(self, pose: Pose, listed: ListedMission | None) -> None:
        """Note a pose at the vehicle's own time: a link may deliver it late."""
        known = listed is not None and self.position.is_known
        place = self.position.place(listed) if listed is not None and known else None
        drives = self.status.mode == AUTO and self.status.armed
        self.progress.take(pose, listed, place, self.status.boot_ms * 10**6, drives=drives)

    def fresh(self, within_s: float, now_ns: int) -> bool:
        """Return True if the most important messages come often enough."""
        oldest_ns = now_ns - round(within_s * 1e9)
        return all(name in self._came_ns and self._came_ns[name] > oldest_ns for name in WANTED)

    def complete(self, listed: ListedMission | None) -> bool:
        """Return True if the vehicle's state, and its position in the list, can be determined."""
        known = self.status.is_known and self.position.is_known
        return known and (listed is None or self.poses.fix is not None)

    def mode_explained(self, now_ns: int) -> bool:
        """Return True if clock and item came since the mode changed, which a reboot or an end may explain."""
        return self.status.mode_explained(self.position.current_ns, now_ns)

    def observe(
        self, run: Run, listed: ListedMission, arrived: Arrived | None = None, *, after: Picture = NONE_YET
    ) -> Observation | None:
        """Return the observation of the vehicle, if enough is known.

        `arrived` is its arrival at the current stop; only scans made after the one named `after` count.
        """
        if not (self.status.is_known and self.position.is_known):
            return None
        newest = self.poses.fix
        fix = newest if newest is not None and newest.ns > self.position.since_ns else None
        report = self._report(run, listed, arrived, after)
        return Observation(
            mode=self.status.mode, armed=self.status.armed, place=self.position.place(listed),
            pose=None if fix is None else fix.pose,
            still=fix is not None and fix.still,
            scan=None if report is None else report.capture.result,
            stood=scan_pose(report, arrived),
            is_jumped=self.position.is_jumped(run, listed),
            failsafe=self.status.failsafe_text(), moved=self._moved(run, listed),
        )  # fmt: skip

    def _moved(self, run: Run, listed: ListedMission) -> str:
        stops = listed.stops
        return self._scan_watch.why(listed, stops[run.at].stop) if run.at < len(stops) else ""

    def capture(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> Capture | None:
        """Return the last report of a scan at the current stop."""
        report = self._report(run, listed, arrived, after)
        return None if report is None else report.capture

    def _report(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> CaptureReport | None:
        """Return the report of the current stop's scan; none from before its trigger."""
        report = self.captures.of_stop(run, listed, arrived, after)
        if report is None or self.position.place(listed) >= listed.stops[run.at].after:
            return report
        stop = listed.stops[run.at].stop
        return report if self._scan_watch.is_after_trigger(listed, stop, report.ns) else None

"""The mission's frame at the vehicle: from its local metres to the mission's, and back."""

from __future__ import annotations

from stopgo.bridge.mavlink.driving.autopilot_telemetry import AutopilotTelemetry
from stopgo.mission.document import Mission
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import UNPLACED, LocalFrame, VehicleOrigin, apart, local_frame
from stopgo.mission.run.events import Pose


class MissionFrame:
    """The current mission, and the vehicle's pose in its frame."""

    def __init__(self, telemetry: AutopilotTelemetry, rule: str) -> None:
        self.mission: Mission | None = None
        self._telemetry = telemetry
        self._rule = rule
        self._local = UNPLACED
        self._local_for: tuple[SiteOrigin | None, VehicleOrigin | None] = (None, None)

    def pose(self) -> Pose:
        north, east = self._telemetry.position()
        return self._frame().pose(north, east, self._telemetry.yaw())

    def yaw(self, heading: float) -> float:
        """Yaw from north of a heading in the mission's frame."""
        return self._frame().yaw(heading)

    def _frame(self) -> LocalFrame:
        """The mission's frame from the autopilot's origin; east and north while either is unknown."""
        site = None if self.mission is None else self.mission.georeference
        now = (site, self._telemetry.origin())
        if now != self._local_for:
            self._local, self._local_for = self._framed(*now), now
        return self._local

    def _framed(self, site: SiteOrigin | None, origin: VehicleOrigin | None) -> LocalFrame:
        if site is None:
            return UNPLACED
        if origin is None or apart(site, origin):
            return LocalFrame(site)
        return local_frame(site, origin, self._rule)

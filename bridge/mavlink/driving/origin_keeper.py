"""Origin of an autopilot during its missions: given again after a restart, or given first with consent."""

from __future__ import annotations

import math
import time

from stopgo.bridge.mavlink.driving.autopilot_telemetry import ORIGIN_S, AutopilotTelemetry
from stopgo.bridge.mavlink.vehicle_link.messages import set_origin
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.document import Mission
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.local_frame import VehicleOrigin, apart

UNREPORTED_S = 3.0
"""Time without a report of the origin, although it was requested, after which there is none."""


class OriginKeeper:
    """Gives the autopilot the origin of the present mission whenever it has lost it; `keep` is called often.

    It sends only the origin that the autopilot was seen to have, and that the mission needs. With `consents`
    it also sends the mission's own, to an autopilot that reports none.
    """

    def __init__(self, peer: Peer, telemetry: AutopilotTelemetry, *, consents: bool = False) -> None:
        self.mission: Mission | None = None
        self.consents = consents
        self._peer = peer
        self._telemetry = telemetry
        self._boots = peer.boots
        self._boot_s = -math.inf
        """Time of the last restart: an origin that was reported before is lost."""
        self._missing_since_s: float | None = None
        self._seen: VehicleOrigin | None = None

    def keep(self) -> None:
        """Send the origin if the autopilot reports a position, and no origin since a few seconds."""
        now_s = time.monotonic()
        if self._peer.boots != self._boots:
            self._boots, self._boot_s = self._peer.boots, now_s
        reported = self._telemetry.origin(max(self._boot_s, now_s - ORIGIN_S))
        if reported is not None:
            self._seen, self._missing_since_s = reported, None
            return
        if self._missing_since_s is None:
            self._missing_since_s = now_s
        origin = self._wanted()
        if origin is None or self._telemetry.why_unknown():
            return
        if now_s > self._missing_since_s + UNREPORTED_S:
            self._peer.send(set_origin(self._peer.who, origin))
        self._peer.request(MessageId.GPS_GLOBAL_ORIGIN)

    def _wanted(self) -> VehicleOrigin | None:
        site = None if self.mission is None else self.mission.georeference
        if site is None:
            return None
        if self._seen is not None and not apart(site, self._seen):
            return self._seen
        return VehicleOrigin(lat=site.lat, lon=site.lon, alt=site.alt) if self.consents else None

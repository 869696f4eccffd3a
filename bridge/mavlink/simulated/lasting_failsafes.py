"""Failsafes of the simulated vehicle for as long as their cause lasts, as its SYS_STATUS reports them.

A battery's failsafe lasts until the next boot, as ArduPilot's (AP_BattMonitor: BATTERY_RESET aside).
"""

from __future__ import annotations

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFaults
from stopgo.mission.mavlink.following.vehicle_health import (
    BATTERY_BIT,
    ESTIMATE_BIT,
    FENCE_BIT,
    REMOTE_CONTROL_BIT,
)

BATTERY, REMOTE_CONTROL, FENCE, ESTIMATE = 0, 1, 3, 5
"""Causes, in the order of `Autopilot.failsafe_texts`."""
BITS = {BATTERY: BATTERY_BIT, REMOTE_CONTROL: REMOTE_CONTROL_BIT, FENCE: FENCE_BIT, ESTIMATE: ESTIMATE_BIT}
LASTS_NS = 20 * 10**9
"""Time after which any other cause is over."""
FOREVER_NS = 2**62


class LastingFailsafes:
    """The causes that last; a fence and a remote control exist only where a fault concerns them."""

    def __init__(self, faults: VehicleFaults) -> None:
        self._until_ns: dict[int, int] = {}
        concerned = {int(fault.amount) for fault in faults.all if fault.kind == "failsafe"}
        self.enabled = sum(BITS[cause] for cause in {BATTERY, ESTIMATE, *concerned} if cause in BITS)
        """Bits of the sensors that are present and switched on."""

    def begin(self, cause: int, now_ns: int) -> None:
        self._until_ns[cause] = FOREVER_NS if cause == BATTERY else now_ns + LASTS_NS

    def reset(self) -> None:
        """Forget all causes, as a boot does."""
        self._until_ns.clear()

    def healthy(self, now_ns: int) -> int:
        """Bits of the sensors that are healthy."""
        lasting = (cause for cause, end_ns in self._until_ns.items() if now_ns < end_ns)
        bad = sum(BITS.get(cause, 0) for cause in lasting)
        return self.enabled & ~bad

"""The simulated scanner as a MAVLink camera: it counts its pictures and reports each, also again."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.mavlink.simulated.replies import picture
from stopgo.bridge.mavlink.simulated.rover import Rover
from stopgo.bridge.mavlink.simulated.vehicle_faults import Mishaps
from stopgo.bridge.mavlink.simulated.vehicle_scanner import ScanEnd, VehicleScanner
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.mission.mavlink.telemetry import Message


class Camera:
    """One scan at a time, of a rover that should be stationary meanwhile.

    Parameters
    ----------
    default_s
        Seconds of a scan whose trigger gives none.
    """

    def __init__(
        self, store: Store, rover: Rover, mishaps: Mishaps, *, default_s: Callable[[], float]
    ) -> None:
        self._store, self._rover, self._default_s = store, rover, default_s
        self._scanner = VehicleScanner(mishaps)
        self.last = 0
        """Number in the trigger of the newest scan."""
        self.triggers = 0
        """Commands to take a picture since the boot, as an autopilot counts them, also repeated ones."""
        self.reports: dict[int, Message] = {}
        """Report of each scan since the boot, by its index."""

    @property
    def due_ns(self) -> int | None:
        """End of the current scan."""
        return None if self._scanner.scan is None else self._scanner.scan.ends_ns

    @property
    def under_way(self) -> int | None:
        """Number in the trigger of the current scan."""
        return None if self._scanner.scan is None else self._scanner.scan.number

    @property
    def count(self) -> int:
        """Scans that were begun, ever."""
        return self._store.stored.images

    @property
    def newest(self) -> Message | None:
        """Report of the scan that ended last."""
        return next(reversed(self.reports.values()), None)

    def begin(self, number: int, seconds: float, now_ns: int) -> bool:
        """Begin a scan; false if one is in progress. 0 seconds: not given."""
        lasts, pose = seconds if seconds > 0 else self._default_s(), self._rover.at(now_ns)[0]
        if not self._scanner.begin(number, lasts, index=self.count, pose=pose, now_ns=now_ns):
            return False
        self._store.update(images=self.count + 1)
        self.last = number
        return True

    def end(self, now_ns: int, boot_ms: int) -> tuple[Message, str]:
        """Report of the scan that is due, and the reason if it failed."""
        done = self._scanner.end(self._rover.at(now_ns)[0])
        message = self.reports[done.index] = self._message(done, now_ns, boot_ms)
        return message, f"Scan {done.number}: {done.why}" if done.why else ""

    def stop(self) -> None:
        """Break the scan off without a report."""
        self._scanner.stop()

    def reset(self, *, is_apart: bool) -> None:
        """Forget the reports, but not their number, as a reboot of the autopilot does.

        A camera that is a component of its own goes on.
        """
        self.triggers = 0
        if is_apart:
            return
        self._scanner.stop()
        self.reports.clear()

    def _message(self, done: ScanEnd, now_ns: int, boot_ms: int) -> Message:
        """Report with the estimated position: the autopilot knows no other."""
        pose = self._rover.estimate(now_ns).pose
        return picture(
            done.index, boot_ms=boot_ms, now_ns=now_ns, place=self._rover.place((pose.x, pose.y)),
            alt_mm=self._rover.alt_mm, heading=pose.heading, file_url=done.file_url,
        )  # fmt: skip

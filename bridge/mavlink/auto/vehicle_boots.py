"""Boots of a vehicle, found by its own clock: a restart, a link that delivers late, or neither.

A clock that went back was restarted. A report that seems to come from a later boot may also be one that the
link has delayed. It is a delayed one if the vehicle's clock has run for longer than nobody listened.
Otherwise the next reports decide: after a delay they catch up at once, after a restart they do not. An armed
vehicle was not restarted, as autopilots boot disarmed: the station's date may have been set.
"""

from __future__ import annotations

import threading
import uuid
from typing import Literal

import msgspec

from stopgo.bridge.robot.journal import Journal
from stopgo.mission.mavlink.telemetry import has_restarted

REBOOT_NS = 5 * 10**9
"""Shift of the begin of a vehicle's clock that no drift and no usual delay causes."""
DOUBT_NS = 2 * 10**9
"""Time within which a delayed link has delivered all that it held back."""
CATCHES_UP_NS = 10**9
"""A clock that gained more than this meanwhile was delivered late."""
STORE_NS = 10 * 10**9
"""Interval at which the newest report is stored."""
EARLIER_NS = 10**9
"""A report that shows a begin earlier by more than this is stored at once; one a bit earlier is not."""
DRIFT = 1e-4
"""Largest difference in rate between the clocks of vehicle and station."""

BootVerdict = Literal["same", "restarted", "in doubt"]


class Boot(msgspec.Struct, frozen=True, kw_only=True):
    """The vehicle's last boot."""

    boot_id: str
    began_ns: int
    """Its latest possible time, by the station's clock."""
    seen_ns: int = 0
    """Time of the last report in it."""
    seen_ms: int = 0
    """Time since boot in that report."""


class VehicleBoots:
    """Takes the vehicle's times since boot; the boots are stored, so that all processes agree on them."""

    def __init__(self, journal: Journal) -> None:
        self.boot_ms = 0
        """Time since boot, as last reported."""
        self._journal = journal
        self._lock = threading.Lock()
        self._seen: Boot | None = None
        """The last boot and report in this process."""
        self._doubt: tuple[int, int] | None = None
        """The first report that may be of another boot, likewise."""
        self._earliest_ns: int | None = None
        """Begin of the vehicle's clock by the promptest report of late."""

    @property
    def boot_id(self) -> str:
        boot = self._boot
        return boot.boot_id if boot else "unknown"

    @property
    def late_s(self) -> float:
        """Delay of the last report, seconds, compared with the promptest one of this process."""
        if self._seen is None or self._earliest_ns is None:
            return 0.0
        return (self._seen.seen_ns - self._seen.seen_ms * 10**6 - self._earliest_ns) / 1e9

    def take(self, now_ns: int, boot_ms: int, *, armed: bool = False) -> BootVerdict:
        """Take a report, and return whether the vehicle was restarted since the last one."""
        with self._lock:
            return self._take(now_ns, boot_ms, armed=armed)

    def _take(self, now_ns: int, boot_ms: int, *, armed: bool) -> BootVerdict:
        self.boot_ms, began_ns = boot_ms, now_ns - boot_ms * 10**6
        now = Boot(boot_id=_new_id(), began_ns=began_ns, seen_ns=now_ns, seen_ms=boot_ms)
        boot = self._boot or self._first(now)
        last = self._seen if self._seen is not None and self._seen.boot_id == boot.boot_id else boot
        verdict = self._verdict(boot, last, now_ns, boot_ms)
        if verdict == "in doubt" and armed:
            verdict = "same"
        if verdict == "in doubt":
            return verdict
        self._doubt = None
        if verdict == "restarted":
            verdict = "restarted" if self._begin(boot, now) else "same"
            self._note(now, began_ns)
            return verdict
        now = msgspec.structs.replace(now, boot_id=boot.boot_id)
        if began_ns < boot.began_ns - EARLIER_NS or now_ns > boot.seen_ns + STORE_NS:
            self._store(msgspec.structs.replace(now, began_ns=min(began_ns, boot.began_ns)))
        self._note(now, began_ns)
        return verdict

    def _note(self, now: Boot, began_ns: int) -> None:
        before, self._seen = self._seen, now
        if before is None or self._earliest_ns is None or before.boot_id != now.boot_id:
            self._earliest_ns = began_ns
        else:
            drifted_ns = self._earliest_ns + round((now.seen_ns - before.seen_ns) * DRIFT)
            self._earliest_ns = min(began_ns, drifted_ns)

    def _verdict(self, boot: Boot, last: Boot, now_ns: int, boot_ms: int) -> BootVerdict:
        if has_restarted(last.seen_ms, boot_ms):
            return "restarted"
        if now_ns - boot_ms * 10**6 <= boot.began_ns + REBOOT_NS:
            return "same"
        if self._doubt is None and now_ns - last.seen_ns < boot_ms * 10**6:
            return "same"  # it was up already when it was last heard: the link is late, or its clock slow
        if self._doubt is None:
            self._doubt = now_ns, boot_ms
        doubted_ns, doubted_ms = self._doubt
        passed_ns = now_ns - doubted_ns
        if (boot_ms - doubted_ms) * 10**6 > passed_ns + CATCHES_UP_NS:
            return "same"
        return "restarted" if passed_ns >= DOUBT_NS else "in doubt"

    def _first(self, now: Boot) -> Boot:
        """Store the first boot, unless another process has done that already; the stored one."""
        with self._journal.transaction():
            stored = self._boot
            if stored is None:
                self._store(now)
            return stored or now

    def _begin(self, before: Boot, now: Boot) -> bool:
        """Store another boot; false if another process has done that already."""
        with self._journal.transaction():
            stored = self._boot
            if stored is not None and stored.boot_id != before.boot_id:
                return False
            self._store(now)
        return True

    @property
    def _boot(self) -> Boot | None:
        return self._journal.fact("boot", Boot)

    def _store(self, boot: Boot) -> None:
        self._journal.store_fact("boot", boot)


def _new_id() -> str:
    return uuid.uuid4().hex[:12]

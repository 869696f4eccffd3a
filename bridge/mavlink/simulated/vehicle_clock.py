"""Time of the simulated vehicle: its run, its time since boot, and the time in which it is silent."""

from __future__ import annotations

from stopgo.bridge.link.clock import Clock

BOOT_NS = 1_000_000_000


class VehicleClock:
    """The run's time, which may be sped up, and the wall's time, by which stations measure.

    With `boots_by_wall` the wall's clock counts the time since boot. Frames overtake each other in the wall's
    time, so a faster count would seem to go back by a reboot.
    """

    def __init__(self, run: Clock, wall: Clock, *, boots_by_wall: bool) -> None:
        self._run, self._wall = run, wall
        self._boots_by_wall = boots_by_wall
        self._made_ns = self._booted_wall_ns = wall.now_ns()
        self._silent_until_ns = 0
        self.booted_ns = run.now_ns()
        self.now_ns = self.booted_ns
        """Time of the present event, in the run's time."""

    @property
    def run_ns(self) -> int:
        """The run's time, to which events are brought up."""
        return self._run.now_ns()

    @property
    def wall_ns(self) -> int:
        return self._wall.now_ns()

    @property
    def made_s(self) -> float:
        """Seconds of the wall's time since the vehicle was made."""
        return (self._wall.now_ns() - self._made_ns) / 1e9

    @property
    def up_ns(self) -> int:
        """Run time since the boot."""
        return self.now_ns - self.booted_ns

    @property
    def boot_ms(self) -> int:
        """Time since the boot as the vehicle reports it."""
        up_ns = self._wall.now_ns() - self._booted_wall_ns if self._boots_by_wall else self.up_ns
        return up_ns // 1_000_000 & 0xFFFFFFFF

    @property
    def is_silent(self) -> bool:
        return self._wall.now_ns() < self._silent_until_ns

    def advance(self, now_ns: int) -> None:
        """Go on to a moment of the run, never back."""
        self.now_ns = max(self.now_ns, now_ns)

    def silence(self, lasts_ns: int) -> None:
        """Be silent from now on, for a duration of the wall's time."""
        self._silent_until_ns = self._wall.now_ns() + lasts_ns

    def prolong_silence(self, lasts_ns: int) -> None:
        self._silent_until_ns += lasts_ns

    def boot(self) -> None:
        """Begin again at zero, silent while the vehicle boots."""
        self.booted_ns = self.now_ns
        self._booted_wall_ns = self._wall.now_ns()
        self.silence(BOOT_NS)

"""A thread that commands the base to stand where the journal does not answer while the robot drives.

It reads the ages of lock sections (`lock_waits`) and takes no lock until the journal answers. Long drives and
long scans hold no lock, so they never trip it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from stopgo.bridge.robot.lock_waits import LockWaits
from stopgo.bridge.robot.work_control import WorkControl

ANSWERS_WITHIN_S = 0.5
"""Longest time that the robot drives while its controller waits for the journal."""
LOOK_EVERY_S = 0.05
HELD_AFTER_LOOKS = 5
"""Looks that must see the same section. A program that the system has frozen looks once meanwhile."""
LATE = f"the journal did not answer for {ANSWERS_WITHIN_S:g} s"


class StorageWatchdog:
    """Lets no robot drive whose controller cannot store; `hold` then holds the run with the reason."""

    def __init__(
        self,
        control: WorkControl,
        waits: LockWaits,
        hold: Callable[[str], None],
        say: Callable[[str], None],
    ) -> None:
        self.late = False
        """True from a standstill for the journal until the run is held."""
        self._control = control
        self._waits = waits
        self._hold = hold
        self._say = say
        self._standing: ExitStack | None = None
        self._section: object | None = None
        self._looks = 0

    def watch(self) -> None:
        """Look until the controller is closed."""
        while not self._control.closed.wait(LOOK_EVERY_S):
            self.look()

    def look(self) -> None:
        """Command a driving base to stand if the journal does not answer; hold the run once it does."""
        late = self._waits.longest_s() > ANSWERS_WITHIN_S
        self._count_looks()
        if late and self._control.driving and not self._control.stands:
            self._standing = ExitStack()
            self._standing.enter_context(self._control.standing())
            self._say(f"{LATE}: the robot stands")
        if self._standing is not None and self._looks >= HELD_AFTER_LOOKS:
            self.late = True
        if not late and self._standing is not None:
            self._end_late(self._standing)

    def _count_looks(self) -> None:
        section, before = self._waits.oldest(), self._section
        self._section = section
        self._looks = self._looks + 1 if section is not None and section is before else 1

    def _end_late(self, standing: ExitStack) -> None:
        """Hold the run, then let the robot work again; it goes on by itself if only its program was late."""
        if self.late:
            self._say("the journal answers again: the robot is held until a command comes")
            self._hold(LATE)
        else:
            self._say("the journal answers again: the robot continues")
        self._standing, self.late = None, False
        standing.close()

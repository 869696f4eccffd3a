"""A thread that commands the base to stand where the journal does not answer while the robot drives.

It reads the ages of lock sections (`lock_waits`) and takes no lock. Long drives and long scans hold no lock,
so they never trip it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from stopgo.bridge.robot.lock_waits import LockWaits
from stopgo.bridge.robot.work_control import WorkControl

ANSWERS_WITHIN_S = 0.5
"""Longest time that the robot drives while its controller waits for the journal."""
LOOK_EVERY_S = 0.05


class StorageWatchdog:
    """Lets no robot drive whose controller cannot store; the robot drives on once the journal answers."""

    def __init__(self, control: WorkControl, waits: LockWaits, say: Callable[[str], None]) -> None:
        self._control = control
        self._waits = waits
        self._say = say
        self._standing: ExitStack | None = None

    def watch(self) -> None:
        """Look until the controller is closed."""
        while not self._control.closed.wait(LOOK_EVERY_S):
            self.look()

    def look(self) -> None:
        """Command a driving base to stand if the journal does not answer; let it drive once it does."""
        late = self._waits.longest_s() > ANSWERS_WITHIN_S
        if late and self._standing is None and self._control.driving:
            self._standing = ExitStack()
            self._standing.enter_context(self._control.standing())
            late_s = f"{ANSWERS_WITHIN_S:g} s"
            self._say(f"the journal has not answered for {late_s}: the robot is stationary until it does")
        elif not late and self._standing is not None:
            standing, self._standing = self._standing, None
            self._say("the journal answers again: the robot continues")
            standing.close()

"""An autopilot as seen from the computer on its robot: its telemetry, its mode control and its setpoints.

A thread requests telemetry that does not come, and repeats a stop and a standstill that are still pending.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from stopgo.bridge.console import say
from stopgo.bridge.mavlink.driving.autopilot_telemetry import ASK_S, POSE, AutopilotTelemetry, NewestMessages
from stopgo.bridge.mavlink.driving.command_refusal import COMMAND_S
from stopgo.bridge.mavlink.driving.mode_control import ModeControl
from stopgo.bridge.mavlink.driving.origin_keeper import OriginKeeper
from stopgo.bridge.mavlink.driving.setpoints import Setpoints
from stopgo.bridge.mavlink.driving.stop_guard import StopGuard, is_available
from stopgo.bridge.mavlink.vehicle_link.messages import on_board_beat, set_origin
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters, set_parameter
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, found
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import Who, wire
from stopgo.mission.errors import InputError, RobotUnreachable
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.autopilots.kind import ALONE_S, why_no_rover
from stopgo.mission.mavlink.enums import Component, MessageId
from stopgo.mission.mavlink.local_frame import VehicleOrigin

ON_BOARD = Who(253, Component.ONBOARD_COMPUTER)
"""Our own address: neither QGroundControl (255) nor a station of ours (254)."""
TICK_S = 0.1
SOONEST_GIVEN_UP_S = 0.3
"""Least duration of a course, whatever a parameter says: an autopilot checks it at intervals."""


@contextmanager
def on_board(
    url: Url,
    *,
    signing_key: bytes | None = None,
    vehicle: int | None = None,
    timeout_s: float = 30.0,
    sets_timeout: bool = False,
) -> Iterator[OnboardAutopilot]:
    """The autopilot at `url`, once it reports its position.

    `sets_timeout`: set the time that it drives on without us, if it is longer than `ALONE_S`.

    Raises
    ------
    RobotUnreachable
        If no vehicle is found, or it does not report its position.
    InputError
        If several are found and none was named, or it is of a kind that cannot be driven, or steers like a
        car, or has no such time to set.
    """
    with (
        wire(url, me=ON_BOARD, signing_key=signing_key) as opened,
        found(opened, vehicle, timeout_s=timeout_s, beat=on_board_beat) as peer,
        opened.filling(NewestMessages(peer.who)) as newest,
    ):
        _check_drivable(peer)
        autopilot = OnboardAutopilot(peer, newest)
        try:
            autopilot.await_pose(timeout_s)
            with suppress(RobotUnreachable):
                peer.origin(patience_s=COMMAND_S)  # so that it is known to the first who asks
            autopilot.read_drive_parameters(sets_timeout=sets_timeout)
            yield autopilot
        finally:
            autopilot.close()


def _check_drivable(peer: Peer) -> None:
    if not peer.autopilot.drivable:
        known = " and ".join(name for name, kind in AUTOPILOTS.items() if kind.drivable)
        raise InputError(
            f"--controller: an autopilot of kind {peer.autopilot.name!r} cannot be driven; {known} can"
        )
    no_rover = why_no_rover(peer.heartbeat.type)
    if no_rover:
        raise InputError(f"--controller: {no_rover}")


class OnboardAutopilot:
    """A vehicle that was found, with the parts by which a robot drives it."""

    def __init__(self, peer: Peer, newest: NewestMessages) -> None:
        self.peer = peer
        self.kind = peer.autopilot
        self.gives_up_s = peer.autopilot.driving.gives_up_s
        """Time for which the vehicle keeps a course that is not sent again."""
        self._closing = threading.Event()
        self.telemetry = AutopilotTelemetry(peer, newest)
        self.control = ModeControl(peer, newest, self._closing)
        self.setpoints = Setpoints(peer, self.telemetry)
        self.origin_keeper = OriginKeeper(peer, self.telemetry)
        self._thread = threading.Thread(target=self._keep_current, name="autopilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; the vehicle stays as it is."""
        self._closing.set()
        self._thread.join()

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Have a process of its own stop the vehicle if this program ends or hangs while it drives."""
        if not is_available():
            say("no process guards the vehicle here: if this program is killed, it drives on by itself")
            yield
            return
        guard = StopGuard(
            self.peer,
            lambda: self.setpoints.is_driving and self.control.is_in_guided_mode,
            self.control.note_guard_stop,
        )
        try:
            yield
        finally:
            guard.close()

    def await_pose(self, timeout_s: float) -> None:
        """Wait until the vehicle has reported its pose.

        Raises
        ------
        RobotUnreachable
            If it does not.
        """
        until = time.monotonic() + timeout_s
        while not self.telemetry.has_pose:
            if time.monotonic() > until:
                raise RobotUnreachable(
                    f"{self.peer}: no position ({', '.join(POSE)}) within {timeout_s:g} s;"
                    " has it an origin, and GNSS or external navigation?"
                )
            self._closing.wait(TICK_S)

    def read_drive_parameters(self, *, sets_timeout: bool) -> None:
        """Read how long the vehicle keeps a course that is not sent again, or set that.

        Raises
        ------
        InputError
            If its parameters say that it cannot turn on the spot, or it does not take the time.
        """
        name = self.kind.driving.gives_up_parameter
        values = read_parameters(self.peer, [name, *self.kind.steering.parameters])
        fixed = self.kind.why_no_pivot(values)
        if fixed:
            raise InputError(
                f"--controller: {self.peer}: {fixed}, as it must at the corners of a mission's legs;"
                " drive one with two driven sides"
            )
        given_up_s = values.get(name)
        if given_up_s is not None:
            self.gives_up_s = max(SOONEST_GIVEN_UP_S, given_up_s)
        if sets_timeout and self.gives_up_s > ALONE_S:
            self.gives_up_s = self._set_timeout(name, given_up_s)
        if self.gives_up_s > ALONE_S:
            remedy = f"; --set-timeout sets {name} to {ALONE_S:g} s" if given_up_s is not None else ""
            say(
                f"{self.peer}: without this computer, or its link, it drives on for up to"
                f" {self.gives_up_s:g} s{remedy}"
            )

    def _set_timeout(self, name: str, before_s: float | None) -> float:
        """Set the time, read it back, and return it.

        Raises
        ------
        InputError
            If the vehicle has no such parameter, or does not report the new value.
        """
        if before_s is None:
            raise InputError(
                f"--set-timeout: {self.peer} does not report {name or 'a parameter for it'}: the"
                f" {self.gives_up_s:g} s that it drives on alone cannot be set; start without --set-timeout"
            )
        after_s = set_parameter(self.peer, name, ALONE_S)
        if after_s is None or not math.isclose(after_s, ALONE_S, rel_tol=1e-3):
            held = "no value" if after_s is None else f"{after_s:g}"
            raise InputError(
                f"--set-timeout: {self.peer} was sent {name} {ALONE_S:g} and reports {held}; set it by hand,"
                " or start without --set-timeout"
            )
        say(f"{self.peer}: {name} was {before_s:g} s and is {ALONE_S:g} s now")
        return after_s

    def restore_origin(self, origin: VehicleOrigin) -> None:
        """Send back the origin that it had; its next report shows if it took it."""
        self.peer.send(set_origin(self.peer.who, origin))
        self.peer.request(MessageId.GPS_GLOBAL_ORIGIN)

    def _keep_current(self) -> None:
        """Until closed: repeat a pending standstill and stop, and request telemetry that is missing."""
        asked_s = -math.inf
        while not self._closing.wait(TICK_S):
            self.setpoints.repeat()
            self.control.repeat_stop()
            if time.monotonic() - asked_s >= ASK_S:
                asked_s = time.monotonic()
                self.telemetry.request_streams()
                self.origin_keeper.keep()

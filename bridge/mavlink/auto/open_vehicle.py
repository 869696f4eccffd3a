"""A vehicle whose line stays open: followed once it is found, and commanded to hold at any time.

`Station`, `follow` and `watch` need not know that it may be away: while it is, nothing answers for it. Its
agent answers on a link in memory, which is there before the vehicle is found, and after its data have ended.

A stop never waits for the vehicle: HOLD goes out at once, also to one that was not found or is silent.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from stopgo.bridge.console import Progress
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import Accepted, KeyExpressions
from stopgo.bridge.mavlink.auto.commanded_standstill import stand
from stopgo.bridge.mavlink.auto.confirmed_commands import Denied
from stopgo.bridge.mavlink.auto.first_hold import held_first, noted_order
from stopgo.bridge.mavlink.auto.mission_push import PushConsent, check_pushable, send_and_remember
from stopgo.bridge.mavlink.auto.vehicle_commands import HOMEWARD
from stopgo.bridge.mavlink.auto.vehicle_station import COMPONENTS, Options, served_on
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, found
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Who, Wire, wire
from stopgo.bridge.station.station import Station, whoami
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import NegativeResult, RobotUnreachable, StopgoError
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.qgc_plan import items_of
from stopgo.mission.mavlink.enums import CommandResult
from stopgo.mission.mavlink.items import Command
from stopgo.mission.run.run_commands import FREE_VERBS, Answer, Verb

AGAIN_S = 1.0
"""Pause between two tries to open the line, or to find the vehicle."""
LOOK_S = 0.2
NOT_IN_AUTO: dict[Verb, str] = {"home": HOMEWARD}
"""Orders that no vehicle carries out that drives its own list, and the reasons."""


class OpenVehicle(Station):
    """Station of one vehicle; `serve` is the work of a thread of its own."""

    def __init__(
        self, name: str, url: Url, options: Options, *, set_origin: bool = False, number: int = 0
    ) -> None:
        """`number` distinguishes the vehicles of one process."""
        self._board = Switchboard()
        super().__init__(
            self._board.link(), KeyExpressions(name), commander=options.commander or whoami(),
            timeout_s=options.timeout_s,
        )  # fmt: skip
        self.url = url
        self._options = options
        self._set_origin = set_origin
        self._me = Who(GROUND_STATION.system, COMPONENTS[(os.getpid() + number) % len(COMPONENTS)])
        self._wire: Wire | None = None
        self._peer: Peer | None = None
        self._one = threading.Lock()
        """Held while a command is carried out that is no stop."""
        self.trouble = "not found yet"
        """Reason why the vehicle is not served; empty if it is."""

    def serve(self, stopped: threading.Event, changed: Callable[[str], None]) -> None:
        """Hold the line open, and serve the vehicle when it is found, until `stopped`.

        `changed` takes the reason why the vehicle is not served, empty if it is.
        """
        while not stopped.is_set():
            try:
                with wire(self.url, me=self._me, signing_key=self._options.signing_key) as opened:
                    self._wire = opened
                    while not stopped.is_set():
                        self._look_for(opened, stopped, changed)
            except StopgoError as error:
                self._change(str(error), changed)
                stopped.wait(AGAIN_S)
            finally:
                self._wire = None

    def _look_for(self, opened: Wire, stopped: threading.Event, changed: Callable[[str], None]) -> None:
        """Look for the vehicle once, and serve it until `stopped` or until its agent fails."""
        options = self._options
        try:
            with (
                found(opened, options.vehicle, timeout_s=options.timeout_s) as peer,
                served_on(self._board, self.keys, self.url, peer, options),
            ):
                self._peer = peer
                self._change("", changed)
                while not stopped.wait(LOOK_S) and self._board.failure is None:
                    pass
        except StopgoError as error:
            self._change(str(error), changed)
            stopped.wait(AGAIN_S)
        finally:
            self._peer = None
            self._board.failure = None

    def _change(self, trouble: str, changed: Callable[[str], None]) -> None:
        if trouble != self.trouble:
            self.trouble = trouble
            changed(trouble)

    @property
    def _is_heard(self) -> bool:
        """True while the vehicle is served, and its data come."""
        return self._peer is not None and not self._board.cut

    def command(self, verb: Verb, **details: Any) -> Answer:
        """Send a command as `Station.command`; a stop goes to a vehicle that is silent or not found, too.

        Raises
        ------
        NegativeResult, OutcomeUnknown, RobotUnreachable
            As `Station.command`.
        """
        if verb not in FREE_VERBS:
            with self._one:
                return super().command(verb, **details)
        if not self._is_heard:
            self._hold_unheard(verb)
        return super().command(verb, **details)

    def _hold_unheard(self, verb: Verb) -> None:
        """Send HOLD until the vehicle is heard and stands.

        Raises
        ------
        NegativeResult
            If it refuses the mode.
        OutcomeUnknown
            If HOLD was sent, and it is not heard in time.
        RobotUnreachable
            If nothing could be sent.
        """
        opened, peer, options = self._wire, self._peer, self._options
        if opened is None:
            raise RobotUnreachable(f"{self.url}: HOLD was not sent: {self.trouble}")
        if peer is not None:
            return _stand(peer, self.timeout_s)
        with (
            held_first(opened, self.url, vehicle=options.vehicle, state=options.state) as hold,
            noted_order(self.url, hold.systems, options.state, verb, self.commander),
        ):
            if not self._await_data():
                raise RobotUnreachable(f"{self.url}: no data within {self.timeout_s:g} s; nothing was sent")

    def _await_data(self) -> bool:
        """Wait until the vehicle is served, and return whether it is."""
        deadline = time.monotonic() + self.timeout_s
        while not self._is_heard and time.monotonic() < deadline:
            time.sleep(LOOK_S / 4)
        return self._is_heard

    @contextmanager
    def hearing(self, heard: Callable[[], None]) -> Iterator[None]:
        """Call `heard` once if the vehicle accepts a change of mode before the block ends."""
        opened, peer = self._wire, self._peer
        if opened is None:
            yield
            return
        over = threading.Event()

        def listen() -> None:
            with opened.waiting("COMMAND_ACK", of=None if peer is None else peer.who) as answers:
                listening.set()
                while True:
                    ended = over.is_set()
                    answer = answers.get(0.0 if ended else LOOK_S)
                    if answer is not None and _accepts_mode(answer):
                        return heard()
                    if answer is None and ended:
                        return None

        listening = threading.Event()
        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        listening.wait(LOOK_S)
        try:
            yield
        finally:
            over.set()
            thread.join()  # an answer that has come is heard

    def push(
        self,
        mission: Mission,
        *,
        progress: Progress = lambda held, size: None,
        take_over: bool = False,
    ) -> Accepted:
        """Put a mission onto the vehicle, as `stopgo push --mavlink` does.

        Raises
        ------
        NegativeResult
            If a run is not over, the vehicle refuses it, or its origin is another.
        OutcomeUnknown
            If data ended after a part was sent.
        """
        heard, peer, options = self._await_data(), self._peer, self._options
        if peer is None or not heard:
            raise RobotUnreachable(f"{self.keys.robot}: {self.trouble or 'no data'}; nothing was sent")
        mission = with_digest(mission)
        consent = PushConsent(set_origin=self._set_origin, any_origin=options.consent.any_origin)
        with self._one:
            sent = items_of(mission, replace(Supplements(), autopilot=peer.autopilot.name))
            check_pushable(self.url, peer, mission, sent, consent, state=options.state, report=_say_nothing)
            done = send_and_remember(self.url, peer, mission, sent, state=options.state, progress=progress)
        return Accepted(
            mission_id=mission.id, revision=mission.revision, digest=mission.digest, already=done.already
        )


def _say_nothing(line: str) -> None:
    """Take a line for a terminal, which a page has not."""


def _stand(peer: Peer, patience_s: float) -> None:
    try:
        stand(peer, patience_s=patience_s)
    except Denied as denied:
        raise NegativeResult(f"{peer}: denied: {denied}", reason="denied") from None


def _accepts_mode(answer: Any) -> bool:
    accepted = (CommandResult.ACCEPTED, CommandResult.IN_PROGRESS)
    return answer.command == Command.DO_SET_MODE and answer.result in accepted

"""The two modes in which an autopilot follows its mission, and stands."""

from __future__ import annotations

from dataclasses import dataclass

from bridge.mavlink.gateway.driving import DRIVING, ROVERS, Driving, Mode
from bridge.mavlink.line.peer import Peer
from bridge.mavlink.line.wire import Message

AUTO, HOLD = "AUTO", "HOLD"
AUTOS = {"ardupilot": Mode(10), "px4": Mode(4, 4)}


@dataclass(frozen=True)
class Modes:
    """One kind of autopilot's."""

    auto: Mode
    hold: Mode
    driving: Driving

    def name(self, heartbeat: Message) -> str:
        """AUTO, HOLD, or what the vehicle's people call the mode it is in."""
        mode = self.driving.mode_of(heartbeat.custom_mode)
        known = {self.auto: AUTO, self.hold: HOLD}
        return known.get(mode, self.driving.name_of(mode))

    def params(self, name: str) -> tuple[float, float, float]:
        """What DO_SET_MODE wants for AUTO or HOLD."""
        return {AUTO: self.auto, HOLD: self.hold}[name].params


def modes_of(peer: Peer) -> Modes:
    """The modes of a vehicle; one of no known kind is taken to number them as PX4 does."""
    kind = peer.autopilot if peer.autopilot in DRIVING else "px4"
    driving = DRIVING[kind]
    return Modes(AUTOS[kind], driving.hold, driving)


def why_unfit(peer: Peer) -> str:
    """Why the vehicle cannot be started from here; empty if it can."""
    kind = peer.heartbeat.type
    return "" if kind in ROVERS else f"vehicle type {kind} is no rover (10) or boat (11)"

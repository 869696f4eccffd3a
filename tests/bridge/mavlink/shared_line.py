"""A line on which each station hears all others, as on a radio or through a router that copies everything."""

from __future__ import annotations

import pytest

from stopgo.bridge.mavlink.vehicle_link.transport import Address
from stopgo.bridge.mavlink.vehicle_link.wire import Wire
from stopgo.mission.mavlink.telemetry import Message

VEHICLE = 1


def all_hear_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the vehicle's end give all that it hears, and all that it says, to everybody."""
    take = Wire._take

    def copied(wire: Wire, address: Address, message: Message) -> None:
        take(wire, address, message)
        if wire.me.system == VEHICLE and message.get_srcSystem() != VEHICLE:
            wire._transport.write(bytes(message.get_msgbuf()), None)

    monkeypatch.setattr(Wire, "_take", copied)
    monkeypatch.setattr(Wire, "_route", lambda wire, system, component: None)

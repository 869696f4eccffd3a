"""The address that each sender's messages come from; of two vehicles with one system id, the first counts.

Vehicles leave the factory with system id 1. Two of them on one port would be taken for one vehicle that
restarts and changes its mission several times a second.
"""

from __future__ import annotations

from stopgo.bridge.mavlink.vehicle_link.transport import Address
from stopgo.mission.mavlink.enums import Component

MOVED_S = 2.0
"""Silence of an autopilot after which it may send from another address: a new port after a reconnect."""
GONE_S = 10.0
"""The same, if the other address was heard between two of its messages: that is another vehicle."""


class SenderAddresses:
    """Last address of every sender. Only the thread that reads calls `accepts`."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], Address] = {}
        self._heard_s: dict[int, float] = {}
        """Time of the last message of each autopilot, by its system id."""
        self._others: dict[int, dict[Address, bool]] = {}
        """Other addresses that use an autopilot's ids; true once they were heard between its messages."""

    def accepts(self, system: int, component: int, address: Address, now_s: float) -> bool:
        """Note the address of a message; false if the message is of another vehicle with the same ids."""
        who = (system, component)
        if component == Component.AUTOPILOT1 and not self._is_same_vehicle(system, address, now_s):
            return False
        self._known[who] = address
        return True

    def address(self, system: int, component: int) -> Address | None:
        """Address of a receiver, or of its system; `None` if it is not known."""
        exact = self._known.get((system, component))
        if exact is not None:
            return exact
        known = self._known.copy()  # at once: the thread that reads adds some
        return next((at for (number, _), at in known.items() if number == system), None)

    def doubled(self, system: int) -> list[Address]:
        """Addresses that send by turns as one and the same autopilot; none if there is only one."""
        others = [at for at, is_other in self._others.get(system, {}).copy().items() if is_other]
        return [self._known[system, Component.AUTOPILOT1], *others] if others else []

    def _is_same_vehicle(self, system: int, address: Address, now_s: float) -> bool:
        bound = self._known.get((system, Component.AUTOPILOT1), address)
        others = self._others.setdefault(system, {})
        if address == bound:
            self._others[system] = dict.fromkeys(others, True)
        else:
            is_other = others.setdefault(address, False)
            if now_s - self._heard_s[system] < (GONE_S if is_other else MOVED_S):
                return False
            self._others[system] = {}
        self._heard_s[system] = now_s
        return True

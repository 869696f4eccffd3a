"""Remote control of the simulated vehicle: its channels, and the mode switch on one of them.

As ArduPilot (RC_Channels): an override by a station replaces a channel, and RC_CHANNELS reports it so.
"""

from __future__ import annotations

from collections.abc import Sequence

from stopgo.mission.mavlink.autopilots.kind import ModeName

CHANNELS, MODE_SWITCH = 8, 7
"""Number of channels, and the index of the mode switch (ArduPilot Rover: MODE_CH 8)."""
MIDDLE_US = 1500
POSITIONS_US = (1100, 1300, 1425)
"""Values of the mode switch in its positions."""
MODES: tuple[ModeName, ...] = ("manual", "hold", "auto")
"""Mode of each position."""
UPPER_US = (1230, 1360)
"""Values up to which the switch is in the first and second position (RC_Channel::read_6pos_switch)."""
UNTOUCHED = (0, 65_535)


class RemoteControl:
    """Channels in microseconds."""

    def __init__(self) -> None:
        self._channels = [MIDDLE_US] * CHANNELS

    def switch(self, position: int) -> ModeName:
        """Move the mode switch; return the mode of its position."""
        self._channels[MODE_SWITCH] = POSITIONS_US[position]
        return MODES[position]

    def override(self, values: Sequence[int]) -> ModeName | None:
        """Replace channels by a station's; return the mode if that moves the mode switch."""
        before = self._channels[MODE_SWITCH]
        for nth, value in enumerate(values[:CHANNELS]):
            if value not in UNTOUCHED:
                self._channels[nth] = value
        now = self._channels[MODE_SWITCH]
        return None if now == before else MODES[sum(now > upper for upper in UPPER_US)]

    @property
    def channels(self) -> tuple[int, ...]:
        """Microseconds of each channel, as an autopilot reports them."""
        return tuple(self._channels)

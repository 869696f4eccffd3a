"""The log of a real ArduPilot Rover that drove five stops, read by pymavlink once for all who look at it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

LOG = Path(__file__).parents[4] / "shared" / "data" / "logs" / "rover-stop-and-go.BIN"
OF_ROVER_LOG = [
    pytest.mark.together("rover log"),
    pytest.mark.skipif(not LOG.is_file(), reason="../shared/data/logs is not here"),
]
KINDS = ("CMD", "MISE", "SIM", "XKF1", "ORGN", "MSG")


def logged(*kinds: str) -> list[Any]:
    """Messages of some of the kinds, in the order of the log."""
    return [message for message in _all() if message.get_type() in kinds]


@cache
def _all() -> list[Any]:
    reader = DFReader_binary(str(LOG))
    return list(iter(lambda: reader.recv_match(type=list(KINDS)), None))

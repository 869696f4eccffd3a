"""How large the fault tests are: a short form by default, the full one with STOPGO_FAULTS=full."""

from __future__ import annotations

import os

FULL = os.environ.get("STOPGO_FAULTS") == "full"


def size(*, short: int, full: int) -> int:
    """How many trials there are."""
    return full if FULL else short

"""Capabilities of robots beyond their protocol version, and the effect of each missing one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

RECORD: Final = "record"
"""Capability of a robot that records its runs."""

WITHOUT: Final[dict[str, str]] = {
    RECORD: "if the link is lost for longer than 3000 poses, the older poses of the run are unknown",
}
"""Effect of a missing capability, by its name in `Info.capabilities`."""


def told_of_capabilities(names: Iterable[str]) -> str:
    """Return a robot's capabilities in one line, with those that it lacks."""
    has = sorted(names)
    lacks = [f"lacks {name}: {why}" for name, why in WITHOUT.items() if name not in has]
    return "; ".join([", ".join(has) or "nothing beyond version 1", *lacks])

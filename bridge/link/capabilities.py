"""What robots can do beyond the version that they speak, and what a station goes without where one cannot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

RECORD: Final = "record"
"""The capability of a robot that keeps a record of its runs."""

WITHOUT: Final[dict[str, str]] = {
    RECORD: "of a link lost for longer than its last 3000 poses the way stays unknown",
}
"""By the name in `Info.capabilities`: what follows where it is missing."""


def told_of_capabilities(told: Iterable[str]) -> str:
    """What a robot can, and what this stopgo would use and it lacks, in one line."""
    has = sorted(told)
    lacks = [f"lacks {name}: {why}" for name, why in WITHOUT.items() if name not in has]
    return "; ".join([", ".join(has) or "nothing beyond version 1", *lacks])

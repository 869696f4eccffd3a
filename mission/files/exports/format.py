"""Export formats, and the supplements that an export may use in addition to the mission."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, get_args

from stopgo.mission.document import Mission, Point
from stopgo.mission.errors import InputError
from stopgo.mission.files.exports.stretches import Stretches
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.translation_options import ScanWait, Settle, Trigger

if TYPE_CHECKING:
    from ezdxf.document import Drawing


@dataclass(frozen=True)
class FloorDrawing:
    """The drawing a mission was planned on."""

    open: Callable[[], Drawing]
    """A fresh copy each time, since the exporter draws into it."""
    unit: float
    """Metres per drawing unit."""


@dataclass(frozen=True)
class Supplements:
    """Supplements of an exporter; each uses only those that its `Format.uses` names."""

    autopilot: str = "ardupilot"
    trigger: Trigger = "auto"
    scan_wait: ScanWait = "delay"
    settle: Settle = "delay"
    """Options for the mission's items; `stopgo.mission.mavlink.translate` describes each."""
    floor: FloorDrawing | None = None
    coverage: Stretches | None = None
    written: datetime = datetime(1970, 1, 1, tzinfo=UTC)
    """The time that files with a time stamp get."""


def written_as(options: Mapping[str, str | None]) -> Supplements:
    """Supplements by the words given for `--autopilot`, `--trigger`, `--scan-wait` and `--settle-item`.

    Raises
    ------
    InputError
        Naming the option, the word and those that are known.
    """
    given = {option.replace("-", "_"): word for option, word in options.items() if word is not None}
    hints = {"trigger": Trigger, "scan_wait": ScanWait, "settle_item": Settle}
    for option, word in given.items():
        known = get_args(hints[option]) if option in hints else tuple(AUTOPILOTS)
        if word not in known:
            raise InputError(f"--{option.replace('_', '-')} {word}: one of {', '.join(known)}")
    fields = {option.removesuffix("_item"): word for option, word in given.items()}
    return Supplements(**fields)  # type: ignore[arg-type]  # checked above


Writer = Callable[[Mission, Supplements], bytes]
ReadBack = Callable[[bytes, Mission, Supplements], list[Point]]
"""Returns the stops in the file, in the site's frame and in order. It may use the mission's frame and
georeference to transform them, and nothing else of it."""


def _nothing(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    return ()


@dataclass(frozen=True)
class Format:
    """A file format of other programs."""

    suffix: str
    title: str
    write: Writer
    read_back: ReadBack
    tolerance: float
    """Greatest change of a stop's position by writing and reading, in metres."""
    georeferenced: bool = False
    """True if it holds latitudes and longitudes, so that a mission without georeference is refused."""
    uses: tuple[str, ...] = ()
    """Names of the options that it uses, without hyphens in front."""
    notes: Callable[[Mission, Supplements], tuple[str, ...]] = _nothing
    """Returns notes on this export for the user, such as what the format cannot hold."""

"""Colours and classes: one colour per meaning, in every view of every recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stopgo.mission import stages
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.stages import DROP_REASONS

Colour = tuple[int, int, int, int]


SKY: Colour = (86, 180, 233, 255)
ORANGE: Colour = (230, 159, 0, 255)
GREEN: Colour = (0, 158, 115, 255)
YELLOW: Colour = (240, 228, 66, 255)
VERMILION: Colour = (213, 94, 0, 255)
PURPLE: Colour = (204, 121, 167, 255)
"""Okabe and Ito's colours, which people with colour blindness can distinguish."""
RUNS = (PURPLE, SKY, ORANGE, GREEN, YELLOW, VERMILION)
"""Colours of runs that are shown together."""


@dataclass(frozen=True)
class Meaning:
    """Class id of Rerun: hovering shows its label."""

    number: int
    label: str
    colour: Colour


SEEN = Meaning(10, "target: covered by a stop", SKY)
UNSEEN = Meaning(11, "target: covered by no stop yet", (178, 180, 186, 255))
HIDDEN = Meaning(12, "target: visible from no candidate", (88, 92, 100, 255))
NEW = Meaning(13, "target: new in this step", YELLOW)
TARGET = Meaning(14, "target", ORANGE)
ARRIVED = Meaning(40, "arrived", (255, 255, 255, 255))
SCANNED = Meaning(41, "scanned", PURPLE)
SKIPPED = Meaning(42, "skipped", ORANGE)
FAILED = Meaning(43, "failed", VERMILION)

_FIRST_REASON = 20
_DROPPED: Colour = (150, 60, 60, 255)
_REASON_COLOURS: dict[int, Colour] = {
    stages.KEPT: (245, 215, 80, 255),
    stages.OUTSIDE: (120, 75, 75, 255),
    stages.IN_HOLE: (135, 60, 110, 255),
    stages.TOO_CLOSE: (190, 70, 60, 255),
    stages.AT_EDGE: (200, 105, 60, 255),
    stages.OTHER_PART: (110, 95, 150, 255),
}
"""Colours of dropped candidates: dim, and reddish for a reason without its own colour."""


def reason(number: int) -> Meaning:
    """Return the class of candidates whose reason is `DROP_REASONS[number]`."""
    label = DROP_REASONS[number]
    verb = "candidate" if number == 0 else "dropped candidate"
    return Meaning(_FIRST_REASON + number, f"{verb}: {label}", _REASON_COLOURS.get(number, _DROPPED))


MEANINGS = (
    *(SEEN, UNSEEN, HIDDEN, NEW, TARGET, ARRIVED, SCANNED, SKIPPED, FAILED),
    *(reason(number) for number in range(len(DROP_REASONS))),
)

KIND_COLOURS: dict[str, Colour] = {kind.name: (*kind.rgb, 255) for kind in KINDS.values()}
"""Colour of every element kind."""

OUTLINE: Colour = (110, 118, 135, 255)
HOLE: Colour = (175, 95, 120, 255)
ROOM: Colour = (58, 64, 78, 255)
PASSABLE: Colour = (232, 236, 245, 255)
BLOCKED: Colour = VERMILION
DRIVE: Colour = (38, 66, 104, 255)
STOP_AREA: Colour = (50, 120, 85, 255)
GAP: Colour = (255, 255, 255, 255)
RAY: Colour = (235, 215, 110, 70)
EYE: Colour = (255, 235, 120, 255)
PAIR: Colour = (60, 190, 150, 160)
BRIDGE: Colour = VERMILION
ERROR: Colour = (90, 180, 230, 220)
WITHDRAWN: Colour = (112, 112, 122, 255)
ROUTE: Colour = YELLOW
RETURN: Colour = (158, 150, 60, 255)
PLANNED: Colour = (250, 243, 170, 255)
DRIVEN: Colour = PURPLE
ACQUIRED: Colour = SKY
LOST: Colour = VERMILION
SLAB: Colour = (62, 68, 80, 255)

LABEL_GROUNDS: tuple[Colour, ...] = ((18, 20, 26, 255), (121, 122, 125, 255))
"""Background of a label's letters in Rerun's dark and light theme, as measured on pictures.

The letters have the colour of the named object, so named objects are light."""
ROOM_NAME: Colour = (216, 219, 225, 255)
STOP: Colour = (116, 243, 182, 255)
RUNNER_UP: Colour = (255, 212, 140, 255)
DOORWAY: Colour = (190, 225, 255, 255)
WITHDRAWN_STOP: Colour = (216, 216, 222, 255)

STATE_COLOURS: dict[str, Colour] = {
    "IDLE": (110, 110, 120, 255),
    "READY": (90, 140, 220, 255),
    "RUNNING": SKY,
    "PAUSED": YELLOW,
    "HELD": VERMILION,
    "HOMING": PURPLE,
    "FINISHED": GREEN,
    "ABORTED": (160, 50, 0, 255),
    "WAITING": (110, 110, 120, 255),
    "NAVIGATING": (60, 160, 220, 255),
    "SETTLING": (200, 190, 90, 255),
    "SCANNING": (70, 220, 120, 255),
    "VERIFYING": (120, 220, 190, 255),
    "DONE": (70, 140, 90, 255),
    "RETRIABLE": (240, 160, 60, 255),
    "SKIPPED": ORANGE,
    "FAILED": VERMILION,
}
"""Colour of every state of a robot and of a stop."""


def class_rows() -> list[tuple[Any, ...]]:
    """Return the rows of Rerun's annotation context: class id, label, colour."""
    return [(item.number, item.label, item.colour) for item in MEANINGS]

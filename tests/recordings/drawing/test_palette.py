"""Colours with different meanings differ for every eye, and texts are readable on light and dark."""

from __future__ import annotations

from itertools import combinations

import pytest

from stopgo.recordings.drawing import palette
from stopgo.recordings.drawing.blueprint import BACKGROUND
from stopgo.recordings.page import style
from tests.recordings.colours import EYES, contrast, distance

APART = 15.0
"""ΔE at which two thin lines are told apart at a glance."""
TOLD_APART = {
    "planned and driven": (palette.ROUTE, palette.DRIVEN),
    "planned and driven robot": (palette.PLANNED, palette.DRIVEN),
    "seen and not": (palette.SEEN.colour, palette.UNSEEN.colour),
    "seen and new": (palette.SEEN.colour, palette.NEW.colour),
    "acquired and lost": (palette.ACQUIRED, palette.LOST),
    "stops and doorways": (palette.STOP, palette.DOORWAY),
    "a stop and its runners-up": (palette.STOP, palette.RUNNER_UP),
    "stops and withdrawn ones": (palette.STOP, palette.WITHDRAWN_STOP),
    "stops and the route": (palette.STOP, palette.ROUTE),
    "stops and those arrived at": (palette.STOP, palette.ARRIVED.colour),
    "scanned and skipped": (palette.SCANNED.colour, palette.SKIPPED.colour),
    "passable and not": (palette.PASSABLE, palette.BLOCKED),
    "route and way back": (palette.ROUTE, palette.RETURN),
}
STATES = ("RUNNING", "PAUSED", "HELD", "HOMING")


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("pair", TOLD_APART)
def test_what_is_distinguished_by_colour_is_distinguished_by_every_eye(pair: str, eye: str) -> None:
    assert distance(*TOLD_APART[pair], eye) >= APART


@pytest.mark.parametrize("eye", EYES)
def test_states_and_runs_are_distinguished_by_every_eye(eye: str) -> None:
    states = [palette.STATE_COLOURS[name] for name in STATES]
    for colours in (states, palette.RUNS[:4]):
        assert min(distance(a, b, eye) for a, b in combinations(colours, 2)) >= APART


NAMED = (
    *(palette.STOP, palette.DOORWAY, palette.WITHDRAWN_STOP, palette.RUNNER_UP),
    *(palette.ROOM_NAME, palette.EYE),
)
"""Colours of what has a name."""


@pytest.mark.parametrize("ground", palette.LABEL_GROUNDS)
@pytest.mark.parametrize("colour", NAMED)
def test_names_are_read_in_the_light_and_in_the_dark_theme(
    colour: palette.Colour, ground: palette.Colour
) -> None:
    assert contrast(colour, ground) >= 3.0


@pytest.mark.parametrize(
    "colour", [palette.ROUTE, palette.DRIVEN, palette.ACQUIRED, palette.LOST, palette.STOP]
)
def test_lines_stand_out_from_the_ground_of_the_plan(colour: palette.Colour) -> None:
    assert contrast(colour, BACKGROUND) >= 3.0


def test_the_page_is_read_on_paper() -> None:
    for back in style.ANSWERS.values():
        assert contrast(_rgb(back), (255, 255, 255, 255)) >= 4.5
    for back, ink in style.STATES.values():
        assert contrast(_rgb(back), _rgb(ink)) >= 3.0
    for line in (style.BLUE, style.VERMILION, style.GREY):
        assert contrast(_rgb(line), (255, 255, 255, 255)) >= 3.0


def test_the_distance_is_the_one_of_the_books() -> None:
    """Pure red and green of a screen are ΔE 170.6 apart, and near for a deuteranope."""
    assert distance((255, 0, 0, 255), (0, 255, 0, 255), "all colours") == pytest.approx(170.6, abs=0.2)
    assert distance((213, 94, 0, 255), (120, 130, 0, 255), "deuteranopia") < 30


def _rgb(code: str) -> palette.Colour:
    digits = code.removeprefix("#")
    digits = digits if len(digits) == 6 else "".join(2 * digit for digit in digits)
    red, green, blue = (int(digits[k : k + 2], 16) for k in (0, 2, 4))
    return (red, green, blue, 255)

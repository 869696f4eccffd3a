"""The steps of the planning story on its timeline, and the words that stand beside each."""

from __future__ import annotations

import rerun as rr

from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.drawing.markdown import plain

FLOOR, SPACE, CANDIDATES = 0, 1, 2
FIRST_CHOICE = 3
"""The step of the first stop that is chosen; the route comes after the last."""


def step_of_choice(number: int) -> int:
    """The step at which the stop is chosen that is chosen as this one, counted from 1."""
    return FIRST_CHOICE + number - 1


def tell_step(canvas: Canvas, step: int, title: str, *lines: str) -> None:
    """What a step did: a heading and sentences beside the picture, and the heading in the log."""
    canvas.say(f"step {step}: {title}", step=step)
    canvas.at(entities.STORY, markdown(f"Step {step}: {title}", *lines), step=step)


def markdown(title: str, *lines: str) -> rr.TextDocument:
    """A heading and paragraphs, shown letter by letter."""
    body = "\n\n".join((f"# {plain(title)}", *map(plain, lines)))
    return rr.TextDocument(body, media_type="text/markdown")

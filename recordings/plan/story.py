"""Planning steps on their timeline, and the text next to each."""

from __future__ import annotations

import rerun as rr

from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.drawing.markdown import plain

FLOOR, SPACE, CANDIDATES = 0, 1, 2
FIRST_CHOICE = 3
"""Step of the first chosen stop; the route follows the last one."""


def step_of_choice(number: int) -> int:
    """Return the planning step of a choice, counted from 1."""
    return FIRST_CHOICE + number - 1


def describe_step(canvas: Canvas, step: int, title: str, *lines: str) -> None:
    """Describe a step: a heading and sentences next to the picture, and the heading in the log."""
    canvas.say(f"step {step}: {title}", step=step)
    canvas.at(entities.STORY, markdown(f"Step {step}: {title}", *lines), step=step)


def markdown(title: str, *lines: str) -> rr.TextDocument:
    """Return a heading and paragraphs, shown letter by letter."""
    body = "\n\n".join((f"# {plain(title)}", *map(plain, lines)))
    return rr.TextDocument(body, media_type="text/markdown")

"""Reasons for the stops of a plan, embedded in its recording."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import rerun as rr

from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.stages.stop_reasons import StopReason
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.values import Values


def embed_reasons(canvas: Canvas, reasons: Sequence[StopReason]) -> None:
    """Embed the reasons as one document."""
    document = {"document": msgspec.json.encode(reasons).decode()}
    canvas.show(entities.REASONS, rr.DynamicArchetype("Reasons", components=document))


def reasons_in(values: Values, name: str) -> tuple[StopReason, ...]:
    """Return the embedded reasons in the order of driving; error messages begin with `name`.

    Raises
    ------
    InputError
        When they are damaged.
    """
    rows = list(values.rows(entities.REASONS))
    if not rows:
        return ()
    try:
        return decoded(rows[-1]["document"][0], tuple[StopReason, ...])
    except (KeyError, msgspec.DecodeError) as error:
        raise InputError(f"{name}: reasons of its stops are damaged ({error}); plan again") from None

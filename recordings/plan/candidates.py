"""Candidates: every possible position, and why some were dropped."""

from __future__ import annotations

import numpy as np
import rerun as rr

from stopgo.mission.stages import DROP_REASONS, KEPT, Candidates
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER
from stopgo.recordings.plan.story import CANDIDATES, describe_step


def draw_candidates(canvas: Canvas, candidates: Candidates) -> None:
    """Draw every possible position, coloured by its outcome; hovering shows the reason and the room."""
    if not len(candidates.xy):
        canvas.say("no candidate positions", level="WARN", step=CANDIDATES)
        return
    remaining = candidates.reason == KEPT
    points = rr.Points2D(
        canvas.local(candidates.xy),
        class_ids=[palette.reason(int(number)).number for number in candidates.reason],
        radii=np.where(remaining, on_screen(2.2), on_screen(1.5)),
        show_labels=False,
        draw_order=ORDER["candidate"],
    )
    names = [candidates.space.rooms[int(room)].name for room in candidates.room]
    why = [DROP_REASONS[int(number)] for number in candidates.reason]
    canvas.since(entities.CANDIDATES, points, rr.AnyValues(room=names, reason=why), step=CANDIDATES)
    counts = np.bincount(candidates.reason, minlength=len(DROP_REASONS))
    counted = ", ".join(f"{int(count)} {DROP_REASONS[i]}" for i, count in enumerate(counts) if count)
    title = (
        f"candidates ({candidates.strategy}): {candidates.generated} positions generated, "
        f"{candidates.reachable} reachable"
    )
    describe_step(canvas, CANDIDATES, title, f"Of {len(candidates.xy)} positions: {counted}.")

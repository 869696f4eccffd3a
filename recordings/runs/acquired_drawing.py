"""Acquired coverage of a run, drawn as it grows: bold where a scan covered it, thick where it was lost."""

from __future__ import annotations

import numpy as np
import rerun as rr

from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.run.events import Aborted, AnyEvent, Finished, Scanned, Skipped
from stopgo.mission.stages.covered_intervals import lines_along
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.sight import SeenFrom, Sight
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER, Pen, style
from stopgo.recordings.drawing.robot import Draw

BOLD_PX, THICK_PX = 2.5, 5.0
"""Radii in points of the screen of acquired and of lost lines."""
CROSS_M = 0.3
"""Half the size in metres of the cross on a skipped stop."""


class AcquiredDrawing:
    """Acquired coverage of one run so far, and its drawing.

    Coverage of a skipped stop is lost once the remaining stops cannot replace it.
    """

    def __init__(self, sight: Sight) -> None:
        self._sight = sight
        self._stops = {stop.id: stop for stop in sight.stops}
        self._remaining = set(sight.ids)
        self._views = np.zeros(len(sight.totals.weight), dtype=np.int64)
        self._lost = np.zeros(len(sight.totals.weight), dtype=bool)
        self._styled = False

    def draw_event(self, event: AnyEvent, *, canvas: Canvas, names: entities.RunEntities, draw: Draw) -> None:
        """Draw what an event adds; `draw` draws at an entity, at the event's time."""
        self._style(canvas, names)
        if isinstance(event, Scanned) and event.stop in self._stops:
            self._remaining.discard(event.stop)
            before = self._seen
            self._views = self._views + self._sight.views_from([event.stop])
            new = self._seen & ~before
            self._draw(canvas, names.flat(entities.ACQUIRED), new, draw)
        elif isinstance(event, Skipped) and event.stop in self._stops:
            self._give_up([self._stops[event.stop]], canvas, names, draw)
        elif isinstance(event, Finished | Aborted):
            left = [stop for stop in self._sight.stops if stop.id in self._remaining]
            self._give_up(left, canvas, names, draw)

    def sentence(self) -> str:
        """Return the coverage acquired so far, in a sentence."""
        now, planned = self._sight.totals.coverage(self._seen).whole, self._sight.planned.whole
        required = "" if now.required is None else f"{percent(now.required)} required, "
        acquired, planned_percent = percent(now.coverage), percent(planned.coverage)
        return f"**{acquired}** of what is visible is scanned ({required}{planned_percent} planned)"

    @property
    def _seen(self) -> BoolArray:
        """Units covered so far, as a mask (n,)."""
        return self._sight.totals.enough(self._views)

    def _give_up(
        self, stops: list[SeenFrom], canvas: Canvas, names: entities.RunEntities, draw: Draw
    ) -> None:
        """Draw what these skipped stops lose, and the remaining stops do not replace."""
        self._remaining -= {stop.id for stop in stops}
        possible = self._views + self._sight.views_from(self._remaining)
        skipped_units = self._sight.views_from([stop.id for stop in stops]) > 0
        lost = skipped_units & ~self._lost & ~self._sight.totals.enough(possible)
        self._lost |= lost
        self._draw(canvas, names.flat(entities.LOST), lost, draw)
        if stops:
            crosses = canvas.strips(line for stop in stops for line in _cross(stop))
            above = ORDER["scan"] + 1
            mark = rr.LineStrips2D(crosses, colors=palette.LOST, radii=on_screen(3), draw_order=above)
            draw(entities.child(names.flat(entities.MISSING), stops[0].id), mark)

    def _draw(self, canvas: Canvas, entity: str, units: BoolArray, draw: Draw) -> None:
        lines = lines_along(self._sight.targets, units)
        if len(lines):
            draw(entity, rr.LineStrips2D.from_fields(strips=canvas.strips(lines)))

    def _style(self, canvas: Canvas, names: entities.RunEntities) -> None:
        if not self._styled:
            self._styled = True
            style(canvas, names.flat(entities.ACQUIRED), Pen(palette.ACQUIRED, "target", on_screen(BOLD_PX)))
            style(canvas, names.flat(entities.LOST), Pen(palette.LOST, "target", on_screen(THICK_PX)))


def _cross(stop: SeenFrom) -> list[FloatArray]:
    x, y, k = stop.x, stop.y, CROSS_M
    return [np.array([(x - k, y - k), (x + k, y + k)]), np.array([(x - k, y + k), (x + k, y - k)])]

"""A proof as a recording: the floor, the simulated clouds, and which of them register."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from stopgo.mission import __version__
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray, bounds
from stopgo.mission.proof.plan_proof import PlanProof
from stopgo.mission.proof.proof_text import proof_text, verdict
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, Sheet, mission_origin, on_screen, open_canvas
from stopgo.recordings.drawing.pens import ORDER
from stopgo.recordings.embedded.checking import carry_end
from stopgo.recordings.embedded.missions import carry_mission
from stopgo.recordings.plan.floor import draw_floor, raise_floor
from stopgo.recordings.plan.mission import HEAD, draw_mission

POINT_M = 0.012
"""Radius of a point of a cloud."""


def proof_recording(proof: PlanProof, floor: FloorPlan) -> bytes:
    """The recording of a proof; it has the mission's id, so that it lies on the plan's and the runs'."""
    mission = proof.mission
    sheet = Sheet(
        recording_id=mission.id,
        name=f"{mission.name}: proof",
        origin=mission_origin(mission),
        extent=bounds(polygon.exterior for polygon in floor.outline),
    )
    with open_canvas(sheet) as canvas:
        draw_floor(canvas, floor)
        raise_floor(canvas, floor)
        draw_mission(canvas, mission)
        carry_mission(canvas, mission)
        _draw_clouds(canvas, proof)
        _draw_pairs(canvas, proof)
        _draw_targets(canvas, proof)
        report = f"# {mission.name}: proof\n\n```\n{proof_text(proof)}\n```\n"
        canvas.at(
            entities.LATEST_REPORT,
            rr.TextDocument(report, media_type="text/markdown"),
            step=0,
            candidate=0,
            mission_s=0.0,
        )
        canvas.say(verdict(proof), level="INFO" if proof.met else "WARN")
        canvas.describe(
            entities.PROPERTY_PROOF,
            {"met": proof.met, "digest": mission.digest, "revision": mission.revision, "stopgo": __version__},
        )
        carry_end(canvas)
        return canvas.taken()


def _draw_clouds(canvas: Canvas, proof: PlanProof) -> None:
    """The points of every scan in the colour of its piece."""
    piece = {stop: k for k, stops in enumerate(proof.network.pieces) for stop in stops}
    for cloud in proof.clouds:
        colour = palette.RUNS[piece[cloud.stop] % len(palette.RUNS)]
        points = np.column_stack([canvas.local(cloud.xyz[:, :2]), cloud.xyz[:, 2]])
        entity = entities.part(entities.PROVED_CLOUDS, cloud.stop)
        canvas.show(entity, rr.Points3D(points, colors=colour, radii=POINT_M))


def _draw_pairs(canvas: Canvas, proof: PlanProof) -> None:
    """Every pair that shares surfaces, by whether it registers."""
    place = {stop.id: (stop.x, stop.y) for stop in proof.mission.stops}
    for name, wanted, meaning in (
        ("registered", True, palette.SEEN),
        ("loose", False, palette.FAILED),
    ):
        pairs = [pair for pair in proof.network.pairs if pair.registered == wanted]
        if not pairs:
            continue
        lines = [canvas.local(np.array([place[pair.a], place[pair.b]])) for pair in pairs]
        told = [
            f"{pair.a} and {pair.b}: {1000 * pair.error_m:.1f} mm, {pair.error_deg:.3f}°" for pair in pairs
        ]
        look: dict[str, Any] = {"colors": meaning.colour, "labels": told, "show_labels": False}
        flat = rr.LineStrips2D(lines, radii=on_screen(2.5), draw_order=ORDER["candidate"], **look)
        raised = [strokes.level(line, HEAD) for line in lines]
        canvas.show(entities.part(entities.PROVED_PAIRS, name), flat)
        canvas.show(
            entities.part(entities.WORLD_PROVED_PAIRS, name), rr.LineStrips3D(raised, radii=0.04, **look)
        )


def _draw_targets(canvas: Canvas, proof: PlanProof) -> None:
    """What points lie on, and what was promised and missed."""
    for name, lines, meaning in (
        ("acquired", _lines(proof, missed=False), palette.SEEN),
        ("missed", _lines(proof, missed=True), palette.FAILED),
    ):
        if len(lines):
            shape = rr.LineStrips2D(
                canvas.local(lines), colors=meaning.colour, radii=on_screen(1.5), draw_order=ORDER["target"]
            )
            canvas.show(entities.part(entities.PROVED_TARGETS, name), shape)


def _lines(proof: PlanProof, *, missed: bool) -> FloatArray:
    """Stretches of targets (k, 2, 2)."""
    if missed and proof.promised is None:
        return np.empty((0, 2, 2))
    wanted = proof.promised & ~proof.seen if missed and proof.promised is not None else proof.seen
    lines, value = strokes.pieces(proof.targets, wanted.astype(np.int64))
    return lines[value == 1]

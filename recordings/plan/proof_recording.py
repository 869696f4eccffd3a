"""Simulation of a plan's scans as a recording: the floor, the clouds, and which of them register."""

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
from stopgo.recordings.embedded.checking import embed_end
from stopgo.recordings.embedded.missions import embed_mission
from stopgo.recordings.plan.floor import draw_floor, raise_floor
from stopgo.recordings.plan.mission import HEAD, draw_mission

POINT_M = 0.012
"""Radius of a cloud's point."""


def proof_recording(proof: PlanProof, floor: FloorPlan) -> bytes:
    """Return the recording of a simulation; it has the mission's id, so that it overlays plan and runs."""
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
        embed_mission(canvas, mission)
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
        embed_end(canvas)
        return canvas.drain()


def _draw_clouds(canvas: Canvas, proof: PlanProof) -> None:
    """Draw the points of every scan in the colour of its connected component."""
    component = {stop: k for k, stops in enumerate(proof.network.pieces) for stop in stops}
    for cloud in proof.clouds:
        colour = palette.RUNS[component[cloud.stop] % len(palette.RUNS)]
        points = np.column_stack([canvas.local(cloud.xyz[:, :2]), cloud.xyz[:, 2]])
        entity = entities.child(entities.PROVED_CLOUDS, cloud.stop)
        canvas.show(entity, rr.Points3D(points, colors=colour, radii=POINT_M))


def _draw_pairs(canvas: Canvas, proof: PlanProof) -> None:
    """Draw every pair that shares surfaces, by whether it registers."""
    position = {stop.id: (stop.x, stop.y) for stop in proof.mission.stops}
    for name, wanted, meaning in (
        ("registered", True, palette.SEEN),
        ("loose", False, palette.FAILED),
    ):
        pairs = [pair for pair in proof.network.pairs if pair.registered == wanted]
        if not pairs:
            continue
        lines = [canvas.local(np.array([position[pair.a], position[pair.b]])) for pair in pairs]
        labels = [
            f"{pair.a} and {pair.b}: {1000 * pair.error_m:.1f} mm, {pair.error_deg:.3f}°" for pair in pairs
        ]
        look: dict[str, Any] = {"colors": meaning.colour, "labels": labels, "show_labels": False}
        flat = rr.LineStrips2D(lines, radii=on_screen(2.5), draw_order=ORDER["candidate"], **look)
        raised = [strokes.level(line, HEAD) for line in lines]
        canvas.show(entities.child(entities.PROVED_PAIRS, name), flat)
        canvas.show(
            entities.child(entities.WORLD_PROVED_PAIRS, name), rr.LineStrips3D(raised, radii=0.04, **look)
        )


def _draw_targets(canvas: Canvas, proof: PlanProof) -> None:
    """Draw the targets with points on them, and those promised and missed."""
    for name, lines, meaning in (
        ("acquired", _lines(proof, missed=False), palette.SEEN),
        ("missed", _lines(proof, missed=True), palette.FAILED),
    ):
        if len(lines):
            shape = rr.LineStrips2D(
                canvas.local(lines), colors=meaning.colour, radii=on_screen(1.5), draw_order=ORDER["target"]
            )
            canvas.show(entities.child(entities.PROVED_TARGETS, name), shape)


def _lines(proof: PlanProof, *, missed: bool) -> FloatArray:
    """Return lines (k, 2, 2) of targets."""
    if missed and proof.promised is None:
        return np.empty((0, 2, 2))
    wanted = proof.promised & ~proof.seen if missed and proof.promised is not None else proof.seen
    lines, value = strokes.lines_by_value(proof.targets, wanted.astype(np.int64))
    return lines[value == 1]

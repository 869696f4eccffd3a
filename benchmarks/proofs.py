"""Simulated scans of every floor's default plan: promised, visible, acquired, and registered."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.files.coverage_json import Coverage, coverage_json
from stopgo.mission.proof.plan_proof import PlanProof, Simulation
from stopgo.mission.settings import Settings
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.network import error_limits, network_of
from stopgo.planner import plan
from stopgo.planner.floors import options_of, read_floor
from stopgo.planner.scan_simulation.verification import verify

HEAD = (
    *("floor", "stops", "promised", "acquired at 0.1°", "claims not in sight", "missed between rays"),
    *("spacing ≤ 10 mm", "incidence ≤ 70°", "two stops", "not met", "s"),
)
JOINED_HEAD = (
    *("floor", "stops", "promised", "acquired", "promised pairs", "that do not register", "worst of them"),
    *("other pairs that register", "pieces: plan, simulation", "circles close within"),
    *("error of the worst stop: predicted, simulated", "stops within their prediction", "s"),
)


def main() -> None:
    """Verify every floor at hand and put the tables into the README."""
    floors = {name: value for name, value in FLOORS.items() if value[0].exists()}
    rows = [row(name, *verified(*value, register=False)) for name, value in floors.items()]
    joined = [joined_row(name, *verified(*value)) for name, value in floors.items()]
    text = "\n\n".join(
        (
            versions("numpy", "embreex", "small-gicp"),
            table(HEAD, rows),
            NOTE,
            "### Scans that are to register",
            table(JOINED_HEAD, joined),
            JOINED_NOTE,
        )
    )
    put("proofs", text)
    print(text)


NOTE = (
    "Plans with `--no-register`; walls nominally 2.7 m. Claims: units of all stops together. Not met: what the "
    "proof names; a column's side met at 89° is in sight and gets no points. Seconds: proof without files."
)
JOINED_NOTE = (
    "Default plans. Promised pairs are those of the mission's network; worst: of the promised pairs, "
    "from 5 cm and 2° off, to either side. Pieces: what the pairs that register leave. Predicted: with a probability "
    "of 99 %; simulated: after the adjustment of all pairs that register."
)


def verified(path: Path, options: dict[str, float], **more: bool) -> tuple[PlanProof, float]:
    """One floor's verification, and its seconds of processor time."""
    settings = Settings(**options, **more)
    made = plan(read_floor(path, options_of(settings)), settings)
    told = msgspec.json.decode(coverage_json(made.route, made.mission, made.figures), type=Coverage)
    begin = time.process_time()
    simulation = Simulation(range_m=settings.range, joining_m=settings.farthest_overlap, cone_deg=60.0)
    proof = verify(made.mission, made.space, simulation, told)
    return proof, time.process_time() - begin


def row(name: str, proof: PlanProof, seconds: float) -> list[str]:
    """Coverage of a floor's targets by its scans."""
    quality = proof.quality
    claimed = sum(stop.claimed for stop in proof.stops)
    lacking = sum(max(0, stop.claimed - stop.sighted) for stop in proof.stops)
    return [
        *(name, str(len(proof.mission.stops))),
        *(percent(proof.whole.coverage), percent(proof.whole.simulated), f"{lacking} of {claimed}"),
        f"{proof.whole.missed:.1f} m",
        *(
            percent(quality.by_spacing_mm[10]),
            percent(quality.by_incidence_deg[70]),
            percent(quality.by_stops[2]),
        ),
        *("; ".join(proof.unmet) or "-", f"{seconds:.0f}"),
    ]


def joined_row(name: str, proof: PlanProof, seconds: float) -> list[str]:
    """Registration of a floor's scans."""
    network = network_of(proof.mission)
    assert network is not None
    promised = {(item.a, item.b) for item in network.overlaps}
    pairs = {(pair.a, pair.b): pair for pair in proof.network.pairs}
    good = {ends for ends, pair in pairs.items() if pair.registered}
    missed = sorted(promised - good)
    held = [pairs[ends] for ends in promised & set(pairs)]
    worst = f"{1000 * max(p.error_m for p in held):.1f} mm, {max(p.error_deg for p in held):.3f}°"
    closing, limits = proof.network.closing_m, error_limits(proof.mission)
    errors = f"{1000 * max(limits.values(), default=0.0):.1f} mm, {1000 * proof.network.adrift_m:.1f} mm"
    return [
        *(name, str(len(proof.mission.stops))),
        *(percent(proof.whole.coverage), percent(proof.whole.simulated), str(len(promised))),
        *(", ".join(f"{a}-{b}" for a, b in missed) or "none", worst if held else "-"),
        *(
            f"{len(good - promised)} of {len(set(pairs) - promised)}",
            f"{len(network.pieces)}, {len(proof.network.pieces)}",
        ),
        *(
            "-" if closing is None else f"{1000 * closing:.1f} mm",
            errors,
            f"{proof.within_prediction} of {len(limits)}",
        ),
        f"{seconds:.0f}",
    ]


if __name__ == "__main__":
    main()

"""Text and JSON of a verification by simulation: the output of `prove`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec

from stopgo.mission.console.table import printable
from stopgo.mission.document import MissionAllocation
from stopgo.mission.proof.plan_proof import (
    ALLOWED_FRACTION,
    REGISTERED_DEG,
    REGISTERED_M,
    CloudQuality,
    PlanProof,
    PromisedCoverage,
    ProvenArea,
    ScanNetwork,
    ScanPair,
    Simulation,
)
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.network import CONTROL_FRAME, error_limits, frame_of

SCHEMA = "stopgo/proof"
VERSION = 1


def proof_json(proof: PlanProof) -> dict[str, Any]:
    """Return everything except the points; lengths in metres unless a name says otherwise."""
    mission = proof.mission
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "mission": {"id": mission.id, "revision": mission.revision, "digest": mission.digest},
        "floor": {"name": mission.origin.floor, "digest": mission.origin.floor_digest},
        "simulation": msgspec.to_builtins(proof.simulation),
        "met": proof.met,
        "unmet": list(proof.unmet),
        "unit": proof.unit,
        "total": _coverage(proof.whole),
        "rooms": [_coverage(item) for item in proof.rooms],
        "kinds": [_coverage(item) for item in proof.kinds],
        "missed": proof.missed,
        "between_rays": round(proof.between_rays, 4),
        "stops": [msgspec.to_builtins(item) for item in proof.stops],
        "surface": _surface_json(proof.quality),
        "areas": [_area_json(item) for item in proof.areas],
        "network": _network_json(proof.network),
    }


def _surface_json(quality: CloudQuality) -> dict[str, Any]:
    return {
        "total_m2": round(quality.total_m2, 3),
        "seen_m2": round(quality.seen_m2, 3),
        "spacing_mm": {str(key): round(value, 4) for key, value in quality.by_spacing_mm.items()},
        "incidence_deg": {str(key): round(value, 4) for key, value in quality.by_incidence_deg.items()},
        "stops": {str(key): round(value, 4) for key, value in quality.by_stops.items()},
    }


def _area_json(item: ProvenArea) -> dict[str, Any]:
    amounts = {name: round(getattr(item, name), 3) for name in ("claimed_m2", "total_m2", "seen_m2")}
    return {"kind": item.kind, **amounts, "claimed": round(item.claimed, 4), "shown": round(item.shown, 4)}


def _network_json(network: ScanNetwork) -> dict[str, Any]:
    return {
        "closed": network.closed,
        "pieces": [list(piece) for piece in network.pieces],
        "registered": network.registered,
        "closing_m": network.closing_m,
        "closing_deg": network.closing_deg,
        "adrift_m": network.adrift_m,
        "frame": network.frame,
        "errors_m": {stop: round(error, 6) for stop, error in network.errors_m.items()},
        "pairs": [_pair(item) for item in network.pairs],
    }


def _coverage(item: PromisedCoverage) -> dict[str, Any]:
    amounts = {"promised": item.promised, "kept": item.acquired, "beyond": item.beyond}
    rounded = {name: round(amount, 4) for name, amount in amounts.items()}
    simulated = None if item.simulated is None else round(item.simulated, 6)
    return {"name": item.name, **rounded, "coverage": item.coverage, "simulated": simulated}


def _pair(item: ScanPair) -> dict[str, Any]:
    return {
        "a": item.a,
        "b": item.b,
        "shared": round(item.shared, 4),
        "free_deg": None if item.free_deg is None else round(item.free_deg, 1),
        "error_m": round(item.error_m, 5),
        "error_deg": round(item.error_deg, 4),
        "least_error_m": round(item.least_error_m, 5),
        "starts": item.starts,
        "registered": item.registered,
    }


def proof_text(proof: PlanProof) -> str:
    """Return a few lines: the verdict first, then its reasons."""
    lines = [verdict(proof), *(f"  {line}" for line in proof.unmet)]
    for name, several in _sections(proof):
        lines += [f"{name if not k else '':12}{line}" for k, line in enumerate(several)]
    return "\n".join(map(printable, lines))


def verdict(proof: PlanProof) -> str:
    """Return the verdict in one sentence."""
    if not proof.met:
        return "The plan's promise is not met:"
    return f"The plan's promise is met: {coverage_words(proof.whole, proof.unit)}."


def coverage_words(whole: PromisedCoverage, unit: str) -> str:
    """Return the promised and the acquired coverage."""
    if whole.coverage is None:
        return f"{whole.promised:.0f} {unit} promised, {whole.acquired:.0f} acquired"
    return f"{percent(whole.coverage)} promised, {percent(whole.simulated)} acquired"


def _sections(proof: PlanProof) -> Iterator[tuple[str, list[str]]]:
    yield "acquired", [coverage_words(proof.whole, proof.unit), *missed_words(proof)]
    yield "surface", surface_words(proof)
    yield "area", area_words(proof)
    loose = [pair_words(pair) for pair in proof.network.pairs if not pair.registered]
    yield "network", [*network_words(proof), *loose]
    yield "assumed", assumed_words(proof.simulation)


def missed_words(proof: PlanProof) -> list[str]:
    """Return the missed part of the promise by reason, that between two rays, and what was not promised."""
    step = f"{proof.simulation.step_deg:g}°"
    amounts = {
        f"lie between two rays {step} apart; rays aimed at them meet them": proof.between_rays,
        "acquired that were not promised": proof.whole.beyond,
    }
    missed = [f"{amount:.1f} {proof.unit} missed: {reason}" for reason, amount in proof.missed.items()]
    return missed + [
        f"{amount:.1f} {proof.unit} {words}" for words, amount in amounts.items() if amount >= 0.05
    ]


def surface_words(proof: PlanProof) -> list[str]:
    """Return the lines on density and incidence of the points on the surfaces."""
    quality = proof.quality
    spacing = (f"{percent(fraction)} at {limit} mm" for limit, fraction in quality.by_spacing_mm.items())
    angles = (f"{percent(fraction)} at {limit}°" for limit, fraction in quality.by_incidence_deg.items())
    stops = (f"{percent(fraction)} from {least}" for least, fraction in quality.by_stops.items() if least > 1)
    return [
        f"points on {quality.seen_m2:.0f} of {quality.total_m2:.0f} m² of targets",
        f"spacing at most: {', '.join(spacing)}",
        f"incidence at most: {', '.join(angles)}",
        f"stops at least: {', '.join(stops)}",
    ]


def area_words(proof: PlanProof) -> list[str]:
    """Return the lines on the area of promised targets, by the plan and by the model's solids."""
    return [
        f"{item.kind}: {percent(item.claimed)} of the promised targets' area claimed, "
        f"{percent(item.shown)} of {item.total_m2:.0f} m² reached by rays at the model's solids"
        for item in proof.areas
        if item.total_m2
    ]


def network_words(proof: PlanProof) -> list[str]:
    """Return the lines on the connected scans, and on those that are not."""
    network = proof.network
    components = f"the scans are in {len(network.pieces)} components"
    connected = "all scans are connected" if network.closed else components
    if isinstance(allocation := proof.mission.share, MissionAllocation):
        connected = f"of this mission, one of {allocation.of}, {connected}"
    lines = [f"{connected}: {network.registered} of {len(network.pairs)} pairs with common surfaces register"]
    if network.closing_m is not None:
        lines.append(
            f"loops close to {1000 * network.closing_m:.1f} mm and {network.closing_deg or 0.0:.3f}°"
        )
    if network.registered:
        lines += error_words(proof)
    if proof.accuracy_of_more:
        lines.append("the required accuracy is of these and other missions' scans together: not compared")
    if not network.closed:
        lines += [f"connected: {', '.join(piece)}" for piece in network.pieces if len(piece) > 1]
        alone = [piece[0] for piece in network.pieces if len(piece) == 1]
        lines += [f"not connected: {', '.join(alone)}"] if alone else []
    return lines


def error_words(proof: PlanProof) -> list[str]:
    """Return the lines on the position errors of the stops, and on how many are as small as predicted."""
    network, limits = proof.network, error_limits(proof.mission)
    error = f"{1000 * network.adrift_m:.1f} mm in the frame of {network.frame}"
    worst = f"the worst stop, {network.worst}, has a position error of {error}"
    if not limits or network.frame != (frame_of(proof.mission) or CONTROL_FRAME):
        return [worst]
    greatest = 1000 * max(limits.values())
    predicted = f"predicted: at most {greatest:.1f} mm with a probability of 99 %"
    return [
        worst,
        f"{predicted}; {proof.within_prediction} of {len(limits)} stops are within their own prediction",
    ]


def pair_words(pair: ScanPair) -> str:
    """Return the line of one pair, with its error."""
    name = f"{pair.a} and {pair.b}: overlap {percent(pair.shared)}"
    least, most = (f"{1000 * error:.1f}" for error in (pair.least_error_m, pair.error_m))
    interval = most if pair.starts == 1 or least == most else f"{least} to {most}"
    off = f"{interval} mm and {pair.error_deg:.3f}° off"
    if pair.free_deg is not None:
        return f"{name}, unconstrained along {pair.free_deg:.0f}°, {off}"
    return f"{name}, {off}"


def assumed_words(simulation: Simulation) -> list[str]:
    """Return the assumptions of the simulation."""
    along = "the ray" if simulation.slant else "the floor"
    known = "from the model" if simulation.ceiling_known else "nominal"
    start = (
        f"pairs start {100 * simulation.pose_error_m:g} cm and {simulation.pose_error_deg:g}° off"
        if simulation.poses
        else "pairs start without poses"
    )
    cone = (
        f"blind cone of {simulation.cone_deg:g}°"
        if simulation.cone_deg
        else "no blind cone below it (--blind-cone 60 tries a common one)"
    )
    walls = (
        "solids as modelled, doors open, glass passed; "
        if simulation.solids == "model"
        else f"walls up to {simulation.ceiling_m:g} m ({known}), openings equally high; "
        "floor and ceiling level"
    )
    assumed = "" if simulation.step_known else " (assumed)"
    return [
        f"rays every {simulation.step_deg:g}°{assumed} to {simulation.range_m:g} m along {along}, "
        f"noise {1000 * simulation.noise_m:g} mm",
        f"points up to {simulation.joining_m:g} m for registration",
        f"scanner level at {simulation.height_m:g} m, {cone}",
        walls.rstrip("; "),
        f"{start}; registered: from both sides under {1000 * REGISTERED_M:g} mm and {REGISTERED_DEG:g}°",
        f"a promise is met within {100 * ALLOWED_FRACTION:g} percentage point",
    ]

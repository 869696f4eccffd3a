"""HTML page about a simulation of a plan's scans: answer, numbers, picture and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stopgo.mission.floor import FloorPlan
from stopgo.mission.floor.polylines import lines_of
from stopgo.mission.proof.plan_proof import CloudQuality, PlanProof, PromisedCoverage, ScanPair
from stopgo.mission.proof.proof_text import (
    assumed_words,
    coverage_words,
    missed_words,
    network_words,
    verdict,
)
from stopgo.mission.stages.figures import percent
from stopgo.recordings.drawing.strokes import name_point
from stopgo.recordings.page import whole_page
from stopgo.recordings.page.floor_picture import (
    PictureFrame,
    legend,
    line_sample,
    plan_picture,
    stroke,
)
from stopgo.recordings.page.style import ANSWERS, BLUE, GREEN, GREY, VERMILION
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.page.words import grid, number, row, section, shown, tag, tile

UNMET_SHOWN = 12
"""Limit of unmet conditions in the band; the tables list all."""


def proof_html(proof: PlanProof, floor: FloorPlan) -> bytes:
    """Return the page; the same simulation gives the same bytes."""
    parts = [_title(proof), _band(proof), _tiles(proof), _picture(proof, floor), *_tables(proof)]
    return whole_page(f"{proof.mission.name}: proof", "\n".join(parts))


def _title(proof: PlanProof) -> str:
    mission = proof.mission
    about = f"mission {mission.id[:12]}, revision {mission.revision}, floor {mission.origin.floor}"
    return tag("h1", shown(f"{mission.name}: verification by simulation"), " ", tag("small", shown(about)))


def _band(proof: PlanProof) -> str:
    """Return the answer, and the conditions that are not met."""
    lines = "".join(tag("li", shown(line)) for line in proof.unmet[:UNMET_SHOWN])
    more = len(proof.unmet) - UNMET_SHOWN
    lines += tag("li", shown(f"and {more} more")) if more > 0 else ""
    inside = tag("b", shown(verdict(proof))) + (tag("ul", lines) if lines else "")
    return tag("div", inside, class_="band", style=f"background:{ANSWERS['yes' if proof.met else 'no']}")


def _tiles(proof: PlanProof) -> str:
    network, quality, whole = proof.network, proof.quality, proof.whole
    acquired = f"{whole.acquired:.0f} {proof.unit}" if whole.simulated is None else percent(whole.simulated)
    drift = f"worst stop {1000 * network.adrift_m:.1f} mm error" if network.registered else "none registers"
    scans = "one network" if network.closed else f"{len(network.pieces)} components"
    tiles = [
        tile("coverage acquired", acquired, coverage_words(whole, proof.unit)),
        tile("surface with points", f"{quality.seen_m2:.0f} m²", f"of {quality.total_m2:.0f} m² of targets"),
        tile("at 10 mm or closer", percent(quality.by_spacing_mm.get(10)), "of the surface with points"),
        tile("at 70° or steeper", percent(quality.by_incidence_deg.get(70)), "of the surface with points"),
        tile("from two stops", percent(quality.by_stops.get(2)), "of the surface with points"),
        tile("scans", scans, drift),
    ]
    return tag("div", *tiles, class_="tiles")


def _picture(proof: PlanProof, floor: FloorPlan) -> str:
    subject = ReportSubject((proof.mission,), floor=lines_of(floor, name_point))
    picture = plan_picture(subject, None, beneath=lambda frame: _layers(proof, frame))
    marks = [
        (line_sample(BLUE, 2.4), "points lie on it"),
        (line_sample(VERMILION, 5), "promised, and missed"),
        (line_sample(GREY, 1.2, "4 3"), "target without points"),
        (line_sample(GREEN, 3), "scans that register"),
        (line_sample(VERMILION, 1.5, "2 4"), "scans that have common surfaces and do not register"),
    ]
    return section("The floor", picture, legend(marks))


def _layers(proof: PlanProof, frame: PictureFrame) -> Iterator[str]:
    """Draw targets by outcome, and the pairs."""
    promised = proof.seen if proof.promised is None else proof.promised
    missed = promised & ~proof.seen
    yield stroke(frame.along(proof.targets, ~proof.seen & ~missed), GREY, 1.2, stroke_dasharray="4 3")
    yield stroke(frame.along(proof.targets, missed), VERMILION, 5)
    yield stroke(frame.along(proof.targets, proof.seen), BLUE, 2.4)
    position = {stop.id: (stop.x, stop.y) for stop in proof.mission.stops}

    def lines(wanted: bool) -> str:
        pairs = (pair for pair in proof.network.pairs if pair.registered == wanted)
        return frame.path([np.array([position[pair.a], position[pair.b]]) for pair in pairs])

    yield stroke(lines(False), VERMILION, 1.5, stroke_dasharray="2 4")
    yield stroke(lines(True), GREEN, 3)


def _tables(proof: PlanProof) -> Iterator[str]:
    yield section("Acquired", _listed([coverage_words(proof.whole, proof.unit), *missed_words(proof)]))
    columns = [
        section("Rooms", _coverage(proof.rooms, "room", proof.unit)),
        tag("div", section("Kinds", _coverage(proof.kinds, "kind", proof.unit)), _quality(proof.quality)),
        section("Stops", _stops(proof)),
    ]
    yield tag("div", *columns, class_="columns")
    yield section("The network", _listed(network_words(proof)), _pairs(proof.network.pairs))
    yield section("Assumptions", _listed(assumed_words(proof.simulation)))
    digests = (("mission", proof.mission.digest), ("floor", proof.mission.origin.floor_digest))
    lines = (tag("li", shown(f"{name} "), tag("code", shown(digest))) for name, digest in digests)
    yield section("Digests (sha256)", tag("ul", *lines))


def _listed(lines: Sequence[str]) -> str:
    return tag("ul", *(tag("li", shown(line)) for line in lines))


def _coverage(groups: Sequence[PromisedCoverage], what: str, unit: str) -> str:
    rows = [
        row(
            [
                shown(item.name),
                number(item.promised),
                number(item.acquired),
                percent(item.coverage),
                percent(item.simulated),
            ]
        )
        for item in groups
    ]
    return grid((what, f"promised {unit}", f"acquired {unit}", "coverage", "simulated"), rows)


def _stops(proof: PlanProof) -> str:
    rows = [
        row(
            [
                shown(item.stop),
                str(item.claimed),
                str(item.sighted),
                str(item.units),
                f"{item.points / 1e6:.2f}",
            ],
            **({"class_": "missing"} if item.short else {}),
        )
        for item in proof.stops
    ]
    return grid(("stop", "claims units", "visible", "acquired", "million points"), rows)


def _quality(quality: CloudQuality) -> str:
    rows = [
        *(
            row([f"spacing up to {limit} mm", percent(fraction)])
            for limit, fraction in quality.by_spacing_mm.items()
        ),
        *(
            row([f"incidence up to {limit}°", percent(fraction)])
            for limit, fraction in quality.by_incidence_deg.items()
        ),
        *(
            row([f"from {least} stops or more", percent(fraction)])
            for least, fraction in quality.by_stops.items()
        ),
    ]
    return section("Surface with points", grid(("", "fraction"), rows))


def _pairs(pairs: Sequence[ScanPair]) -> str:
    if not pairs:
        return ""
    rows = [
        row(
            [
                shown(f"{pair.a} – {pair.b}"),
                percent(pair.shared),
                number(pair.error_m, 1000),
                number(pair.error_deg, digits=3),
                "" if pair.free_deg is None else f"along {pair.free_deg:.0f}°",
                "yes" if pair.registered else "no",
            ],
            **({} if pair.registered else {"class_": "missing"}),
        )
        for pair in pairs
    ]
    return grid(("pair", "overlap", "error, mm", "error, °", "unconstrained", "registers"), rows)

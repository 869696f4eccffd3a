"""A floor plan depends on what is drawn, not on the order in which it was drawn nor on how often."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import cache

import pytest
from ezdxf.layouts import Modelspace
from floor_drawings import Read, codes, rectangle
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.mission.floor import FloorPlan
from tests.faults.sizes import size

Step = Callable[[Modelspace], object]


def steps() -> list[Step]:
    """One floor with something on every layer, as single strokes of the pen."""
    layers = ("WALLS", "COLUMNS", "BEAMS", "STAIRS", "WINDOWS", "RAILINGS", "A-FURN")
    boxes = [
        lambda m, layer=layer, x=x: rectangle(m, layer, x, 1, x + 0.5, 2)
        for x, layer in enumerate(layers, start=1)
    ]
    return [
        *boxes,
        lambda m: rectangle(m, "FLOOR", 2, 4, 3, 5),
        lambda m: rectangle(m, "FLOOR", 9, 0, 12, 8),
        lambda m: rectangle(m, "ROOMS", 0, 0, 5, 8),
        lambda m: rectangle(m, "ROOMS", 4.5, 0, 9, 8),
        lambda m: m.add_text("hall", dxfattribs={"layer": "ROOMS", "insert": (1, 5)}),
        lambda m: m.add_text("12", dxfattribs={"layer": "ROOMS", "insert": (1, 6)}),
        lambda m: m.add_line((1, 6), (3, 6), dxfattribs={"layer": "WALLS"}),
        lambda m: m.add_line((3, 6), (3, 7), dxfattribs={"layer": "WALLS"}),
        lambda m: m.add_line((5, 3), (5, 4), dxfattribs={"layer": "DOORS"}),
        lambda m: m.add_line((6, 3), (7, 4), dxfattribs={"layer": "PASSAGES"}),
        lambda m: m.add_circle((6, 6), 0.2, dxfattribs={"layer": "COLUMNS"}),
        lambda m: m.add_lwpolyline(
            [(7, 6), (8, 7), (8, 6), (7, 7)], close=True, dxfattribs={"layer": "COLUMNS"}
        ),
    ]


@cache
def in_order(read: Read) -> FloorPlan:
    return read(lambda m: [step(m) for step in steps()])


def content(plan: FloorPlan) -> list[object]:
    """All of a plan that can be compared, coordinates to the last bit."""
    return [
        [ring.tolist() for part in plan.outline for ring in part.rings],
        [
            (room.id, room.name, [ring.tolist() for p in room.polygons for ring in p.rings])
            for room in plan.rooms
        ],
        [(opening.id, opening.line.tolist()) for opening in plan.openings],
        [
            (
                element.id,
                [ring.tolist() for solid in element.solids for ring in solid.rings],
                [line.tolist() for line in element.lines],
            )
            for element in plan.elements
        ],
    ]


@settings(
    max_examples=size(short=10, full=25),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(seed=st.integers(0, 10_000))
def test_the_order_of_entities_does_not_matter(read: Read, seed: int) -> None:
    shuffled = steps()
    random.Random(seed).shuffle(shuffled)
    plan, other = in_order(read), read(lambda m: [step(m) for step in shuffled])
    assert content(other) == content(plan)
    assert other.findings == plan.findings


def test_what_is_drawn_twice_counts_once_and_is_reported(read: Read) -> None:
    once = read(lambda m: [step(m) for step in steps()])
    twice = read(lambda m: [step(m) for step in (*steps(), *reversed(steps()))])
    assert content(twice) == content(once)
    told = {finding.element for finding in twice.findings if finding.code == "duplicate"}
    things = (*once.rooms, *once.openings, *once.elements)
    assert told == {"FLOOR", *(thing.id for thing in things)}


@pytest.mark.parametrize("offset", [0.0, 1e-9])
def test_a_line_drawn_backwards_over_another_is_a_duplicate(read: Read, offset: float) -> None:
    def draw(model: Modelspace) -> None:
        model.add_line((1, 1), (4, 5), dxfattribs={"layer": "WALLS"})
        model.add_line((4, 5), (1 + offset, 1), dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert len(plan.elements) == 1
    assert codes(plan) == ["duplicate"]
    assert plan.findings[0].element == "walls-001"


def test_a_ring_may_start_and_turn_anywhere(read: Read) -> None:
    corners = [(1.0, 1.0), (4.0, 1.0), (4.0, 3.0), (1.0, 3.0)]
    plans = []
    for start in range(4):
        ring = corners[start:] + corners[:start]
        for drawn in (ring, ring[::-1]):
            plans.append(
                read(lambda m, r=drawn: m.add_lwpolyline(r, close=True, dxfattribs={"layer": "WALLS"}))
            )
    assert all(content(plan) == content(plans[0]) for plan in plans)

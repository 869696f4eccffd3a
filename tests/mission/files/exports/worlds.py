"""Missions that ask something of an exporter: corners, ways back, odd names, far coordinates, a map."""

from __future__ import annotations

import math

import msgspec

from stopgo.mission.document import Frame, Mission, with_digest
from stopgo.mission.frames.transform import SiteOrigin, Transform
from tests.mission.worlds import mission_of, room_mission, square_tour, stop

ZURICH = SiteOrigin(lat=47.3769, lon=8.5417, alt=408.0, heading_deg=30.0)
FIJI = SiteOrigin(lat=-17.8, lon=179.99998, alt=12.0, heading_deg=10.0)
"""The antimeridian runs 2 m east of it."""
MAP = Transform(x=100.0, y=-20.0, heading=math.radians(120.0))


def laboratory() -> Mission:
    """Three stops past corners, one named like a formula, one turned beyond π, and a crooked way back."""
    made = mission_of(
        stop("s01", (1.0, 1.0), (1.0, 2.5), (3.25, 4.125), heading=math.radians(200.0)),
        stop("=2+3", (3.25, 4.125), (3.25, 4.125), heading=-3.0),
        stop("Büro 東/3", (3.25, 4.125), (3.25, 6.0), (-2.0, 6.0), (-2.0, 1.5), heading=1.25),
        back=((-2.0, 1.5), (0.0, 0.5), (1.0, 1.0)),
        begin=(1.0, 1.0),
    )
    return with_digest(msgspec.structs.replace(made, name="Halle <2>, Büro\n=1+1", georeference=ZURICH))


def from_the_first_stop() -> Mission:
    """A mission that starts at its first stop and ends at its last."""
    made = mission_of(
        stop("a", (2.0, 2.0)), stop("b", (2.0, 2.0), (5.0, 2.0)), begin=(2.0, 2.0),
    )  # fmt: skip
    return with_digest(msgspec.structs.replace(made, georeference=ZURICH))


def surveyed() -> Mission:
    """Coordinates of a national grid, hundreds of kilometres from the drawing's origin."""
    x, y = 412_345.678901, 234_567.890123
    return mission_of(
        stop("s1", (x, y), (x + 4, y), (x + 4, y + 3)),
        stop("s2", (x + 4, y + 3), (x, y + 3)),
        begin=(x, y),
    )


def on_a_map() -> Mission:
    """The laboratory, whose frame says where it lies on the robot's map."""
    made = laboratory()
    return with_digest(msgspec.structs.replace(made, frame=Frame(name="site", to_map=MAP)))


def across_the_date_line() -> Mission:
    """The laboratory in Fiji, with stops on both sides of 180°."""
    return with_digest(msgspec.structs.replace(laboratory(), georeference=FIJI))


MISSIONS = {
    made.__name__: made
    for made in (square_tour, room_mission, laboratory, from_the_first_stop, on_a_map, across_the_date_line)
}
"""Missions of a site's size, all with a georeference."""

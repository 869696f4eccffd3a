"""Positions of models on earth, against values computed by hand; defaults and nonsense are no positions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.ifc.georeference import georeference_of
from stopgo.planner.floors.ifc.model import OnEarth
from tests.faults.sizes import FULL
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import two_rooms

DATA = Path(__file__).parents[5] / "shared" / "data" / "ifc"
METRES_PER_DEGREE = 111_250.0
"""Of latitude between 49 and 52 degrees north, to a thousandth."""
SCHOOL = OnEarth(
    eastings=149626315.910581, northings=413717684.216629, height=0.0, abscissa=1.0, ordinate=6.1e-17,
    crs="EPSG:28992", map_unit_m=1.0, said_by="IfcMapConversion",
)  # fmt: skip
DUPLEX = OnEarth(
    eastings=76670.0, northings=77179.0, height=293.7, abscissa=0.325568154457152, ordinate=0.945518575599318,
    scale=1.0, crs="EPSG:9897", said_by="ePSet_MapConversion", latitude=41.8744, longitude=-87.6394,
)  # fmt: skip


def codes(place: OnEarth) -> set[str]:
    return {item.code for item in georeference_of(place, level=0.0)[1]}


def by_hand(east: float, north: float, *, origin: tuple[float, float, float, float]) -> tuple[float, float]:
    """Latitude and longitude near a projection's origin, as on a plane tangent to the earth."""
    lat0, lon0, east0, north0 = origin
    lat = lat0 + (north - north0) / METRES_PER_DEGREE
    across = 111_412.84 * math.cos(math.radians(lat)) - 93.5 * math.cos(3 * math.radians(lat))
    return lat, lon0 + (east - east0) / across


def test_the_schools_eastings_are_millimetres_of_the_dutch_grid() -> None:
    """49.3 km south and 5.4 km west of Amersfoort's tower: 155 000, 463 000 at 52.15517 N, 5.38721 E."""
    found, odd = georeference_of(SCHOOL, level=3.4)
    lat, lon = by_hand(149_626.3, 413_717.7, origin=(52.15517, 5.38721, 155_000, 463_000))
    assert found is not None
    assert (found.lat, found.lon) == pytest.approx((lat, lon), abs=1e-3)
    assert found.alt == pytest.approx(3.4)
    # West of the tower the grid's north lies west of true north, by the longitude times sin(latitude).
    assert found.heading_deg - 360 == pytest.approx((lon - 5.38721) * math.sin(math.radians(lat)), abs=0.005)
    assert [item.code for item in odd] == ["georeference_unit"]


def test_the_duplex_stands_in_luxembourg_turned_by_71_degrees() -> None:
    """22.8 km south and 3.3 km west of the grid's origin: 80 000, 100 000 at 49.83333 N, 6.16667 E."""
    found, odd = georeference_of(DUPLEX, level=0.0)
    lat, lon = by_hand(76_670, 77_179, origin=(49.833333, 6.166667, 80_000, 100_000))
    assert found is not None
    assert (found.lat, found.lon) == pytest.approx((lat, lon), abs=2e-3)  # the datum lies 100 m aside
    turn = math.degrees(math.atan2(DUPLEX.ordinate or 0, DUPLEX.abscissa or 0))
    assert turn == pytest.approx(71.0, abs=0.1)
    convergence = (lon - 6.166667) * math.sin(math.radians(lat))
    assert found.heading_deg - 360 == pytest.approx(convergence - turn, abs=0.01)
    assert found.alt == 293.7
    assert [item.code for item in odd] == ["georeference_two"]  # the site is in Chicago


@pytest.mark.parametrize("scale", [1000.0, 0.001])
def test_the_scale_of_a_map_conversion_is_never_applied(scale: float) -> None:
    import msgspec

    scaled = msgspec.structs.replace(DUPLEX, scale=scale)
    assert georeference_of(scaled, level=0.0)[0].lat == georeference_of(DUPLEX, level=0.0)[0].lat  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("lat", "lon"),
    [(42.358428955, -71.05977), (42.213, -71.033), (51.50015, -0.12624), (0.0, 0.0), (95.0, 8.0)],
)
def test_a_default_or_impossible_site_is_no_position(lat: float, lon: float) -> None:
    place = OnEarth(latitude=lat, longitude=lon, true_north=(0.0, 1.0))
    assert georeference_of(place, level=0.0)[0] is None
    assert codes(place) == {"georeference_odd"}


def test_a_floor_above_every_site_has_no_position() -> None:
    """Its mission would be refused; elevations in another unit than they say do this."""
    assert georeference_of(SCHOOL, level=1e6)[0] is None
    assert "georeference_odd" in {item.code for item in georeference_of(SCHOOL, level=1e6)[1]}


@pytest.mark.parametrize(
    "said",
    [
        {"eastings": 0.0, "northings": 0.0, "crs": "EPSG:28992"},
        {"eastings": 150_000.0, "northings": 400_000.0, "crs": None},
        {"eastings": 150_000.0, "northings": 400_000.0, "crs": "the usual one"},
        {"eastings": 8.0, "northings": 47.0, "crs": "EPSG:4326"},
        {"eastings": 9e9, "northings": 9e9, "crs": "EPSG:28992"},
    ],
)
def test_a_blank_or_impossible_map_conversion_is_no_position(said: dict[str, Any]) -> None:
    place = OnEarth(**said, said_by="IfcMapConversion")
    assert georeference_of(place, level=0.0)[0] is None
    assert codes(place) == {"georeference_odd"}


def test_a_site_gives_position_and_true_north() -> None:
    """North lies 40° above +x, as in the FZK house: +y is 50° left of it, bearing 310°."""
    place = OnEarth(latitude=49.1, longitude=8.4, elevation=110.0, true_north=(0.766044, 0.642788))
    found, odd = georeference_of(place, level=2.7)
    assert found is not None
    assert (found.lat, found.lon, found.alt) == pytest.approx((49.1, 8.4, 112.7))
    assert found.heading_deg == pytest.approx(310, abs=1e-3)
    assert not odd


def test_latitude_and_longitude_are_those_of_the_sites_own_origin() -> None:
    """A site placed 100 m along +y of a model that faces north: the model's origin lies 100 m south."""
    site = (1.0, 0, 0, 0, 0, 1.0, 0, 100.0, 0, 0, 1.0, 0, 0, 0, 0, 1.0)
    place = OnEarth(latitude=49.1, longitude=8.4, true_north=(0.0, 1.0), site=site)
    found = georeference_of(place, level=0.0)[0]
    assert found is not None
    assert (49.1 - found.lat) * METRES_PER_DEGREE == pytest.approx(100, abs=0.2)
    far = OnEarth(latitude=49.1, longitude=8.4, site=(*site[:7], 4e6, *site[8:]))
    assert georeference_of(far, level=0.0)[0] is None


def test_a_model_that_says_nothing_has_no_position(read: Read) -> None:
    assert read(two_rooms()).georeference is None


def test_a_model_hands_its_position_to_the_floor(read: Read) -> None:
    house = two_rooms()
    house.site.RefLatitude, house.site.RefLongitude = (49, 6, 0), (8, 24, 0, 0)
    found = read(house).georeference
    assert found is not None
    assert (found.lat, found.lon) == pytest.approx((49.1, 8.4))


@pytest.mark.skipif(not (FULL and DATA.exists()), reason="the long form, with ../shared/data")
def test_the_real_duplex_is_read_as_by_hand(models: Path) -> None:
    floor = read_floor(DATA / "duplex.ifc", FloorOptions(storey="Level 1"))
    expected = georeference_of(DUPLEX, level=0.0)[0]
    assert floor.georeference is not None
    assert expected is not None
    assert floor.georeference.lat == pytest.approx(expected.lat)

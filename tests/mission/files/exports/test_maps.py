"""CSV through spreadsheets' rules, GeoJSON through shapely."""

from __future__ import annotations

import csv
import io
import json
import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest
import shapely

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.exports import FORMATS, exported
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.stretches import Stretches
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic, to_geodetic
from tests.mission.files.exports.worlds import across_the_date_line, from_the_first_stop, laboratory
from tests.mission.worlds import square_tour


def table(mission: Mission) -> list[dict[str, str]]:
    data = exported(mission, "csv", Supplements())
    return list(csv.DictReader(io.StringIO(data.decode("utf-8"), newline="")))


def test_a_row_says_where_a_stop_is(mission: Mission) -> None:
    for number, (row, stop) in enumerate(zip(table(mission), mission.stops, strict=True), 1):
        assert row["number"] == str(number)
        assert (float(row["x_m"]), float(row["y_m"])) == (stop.x, stop.y)
        assert math.radians(float(row["heading_deg"])) == pytest.approx(stop.heading)
        place = to_geodetic(mission.georeference, (stop.x, stop.y))
        assert float(row["lat_deg"]) == pytest.approx(place.lat, abs=1e-9)
        assert float(row["lon_deg"]) == pytest.approx(place.lon, abs=1e-9)


def test_without_georeference_there_are_no_degrees() -> None:
    (row, _) = table(msgspec.structs.replace(square_tour(), georeference=None))
    assert not {"lat_deg", "lon_deg", "bearing_deg"} & set(row)


def test_legs_are_well_known_text_for_shapely(mission: Mission) -> None:
    for row, stop in zip(table(mission), mission.stops, strict=True):
        points = shapely.get_coordinates(shapely.from_wkt(row["approach_wkt"]))
        assert points == pytest.approx(np.array(stop.approach))


def test_no_cell_of_text_is_a_formula() -> None:
    rows = table(laboratory())
    assert [row["id"] for row in rows] == ["s01", "'=2+3", "Büro 東/3"]
    for cells in (row["id"] + row["scan_profile"] for row in rows):
        assert not cells.startswith(("=", "+", "-", "@"))


def test_rows_end_as_rfc_4180_says() -> None:
    data = exported(square_tour(), "csv", Supplements())
    assert data.count(b"\r\n") == data.count(b"\n") == 3


def test_the_return_is_reported_where_it_is_left_out() -> None:
    notes = FORMATS["csv"].notes
    assert notes(from_the_first_stop(), Supplements()) == ()
    assert "path back" in notes(laboratory(), Supplements())[0]


def features(mission: Mission, supplements: Supplements | None = None) -> list[dict]:
    document = json.loads(exported(mission, "geojson", supplements or Supplements()))
    assert document["type"] == "FeatureCollection"
    return document["features"]


def test_shapely_opens_every_feature(mission: Mission) -> None:
    for feature in features(mission):
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid
        west, south, east, north = shape.bounds
        assert -180 <= west <= east <= 180
        assert -90 <= south <= north <= 90


def test_points_are_longitude_first_and_true_to_the_ellipsoid(mission: Mission) -> None:
    points = [item for item in features(mission) if item["geometry"]["type"] == "Point"]
    for point, stop in zip(points, mission.stops, strict=True):
        lon, lat = point["geometry"]["coordinates"]
        there = from_geodetic(mission.georeference, Geodetic(lat=lat, lon=lon))
        assert math.dist(there, (stop.x, stop.y)) < 2e-4
        assert point["properties"]["id"] == stop.id


def test_a_leg_is_as_long_on_earth_as_in_the_drawing() -> None:
    pyproj = pytest.importorskip("pyproj")
    earth = pyproj.Geod(ellps="WGS84")
    legs = [item for item in features(laboratory()) if item["properties"]["kind"] in ("leg", "return")]
    assert [leg["properties"]["to"] for leg in legs] == ["s01", "Büro 東/3", "return"]
    for leg in legs:
        lons, lats = zip(*leg["geometry"]["coordinates"], strict=True)
        # Metres at the site's 408 m are that much longer than those on the ellipsoid.
        drawn = leg["properties"]["length_m"] / (1 + 408 / 6_378_137)
        assert earth.line_length(lons, lats) == pytest.approx(drawn, abs=2e-3)


@pytest.mark.parametrize("name", ["geojson", "plan", "waypoints"])
@pytest.mark.parametrize("lat", [89.9999, -90.0])
def test_a_site_at_a_pole_is_refused_with_its_latitude(name: str, lat: float) -> None:
    """Its stops read back elsewhere, which was to be reported as an error of the program."""
    made = laboratory()
    polar = msgspec.structs.replace(made.georeference, lat=lat)
    with pytest.raises(InputError, match=f"georeference.lat is {lat}; .* ±89°, give another position"):
        exported(msgspec.structs.replace(made, georeference=polar), name, Supplements())


def test_a_leg_over_the_date_line_is_cut_there() -> None:
    cut = [item for item in features(across_the_date_line()) if item["geometry"]["type"] == "MultiLineString"]
    assert cut
    for item in cut:
        lines = item["geometry"]["coordinates"]
        for line, after in pairwise(lines):
            assert {line[-1][0], after[0][0]} == {180.0, -180.0}
            assert line[-1][1] == after[0][1]
        assert all(np.ptp([lon for lon, _ in line]) < 1 for line in lines)


def test_coverage_becomes_two_features() -> None:
    seen, unseen = np.array([[[0.0, 0], [1, 0]]]), np.array([[[1.0, 0], [2, 0]], [[2, 0], [2, 5.0]]])
    made = features(square_tour(), Supplements(coverage=Stretches(seen, unseen)))[-2:]
    assert [item["properties"]["kind"] for item in made] == ["seen", "not_seen"]
    assert [len(item["geometry"]["coordinates"]) for item in made] == [1, 2]


def test_stretches_of_a_models_elements_name_them() -> None:
    seen, unseen = np.array([[[0.0, 0], [1, 0]]]), np.array([[[1.0, 0], [2, 0]], [[2, 0], [2, 5.0]]])
    found = Stretches(seen, unseen, ("A",), ("A", "B"))
    made = [item["properties"] for item in features(square_tour(), Supplements(coverage=found))[-3:]]
    assert made == [
        {"kind": "seen", "global_id": "A"},
        {"kind": "not_seen", "global_id": "A"},
        {"kind": "not_seen", "global_id": "B"},
    ]

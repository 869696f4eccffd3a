"""Tables of stops: stopgo's own, a surveyor's, and those that a spreadsheet has been at."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.exports import exported
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.imports.stops_csv import read
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions
from stopgo.mission.frames.transform import SiteOrigin
from tests.mission.files.exports.worlds import laboratory

ZURICH = SiteOrigin(lat=47.3769, lon=8.5417, alt=408.0, heading_deg=0.0)


def track(text: str, origin: SiteOrigin | None = None) -> ImportedRoute:
    return read(text.encode(), "stops.csv", ImportOptions(origin))


def places(text: str) -> list[tuple[float, float]]:
    return [visit.xy for visit in track(text).visits]


def test_two_columns_are_enough() -> None:
    (one, other) = track("x_m,y_m\n1,2.5\n-3e0,+4.\n").visits
    assert (one.xy, other.xy) == ((1.0, 2.5), (-3.0, 4.0))
    assert (one.id, one.heading, one.scan_s, one.via) == (None, None, None, ())


def test_empty_cells_are_unknown() -> None:
    (visit,) = track("id,x_m,y_m,scan_s,heading_deg\n,1,2,,\n").visits
    assert (visit.id, visit.scan_s, visit.heading) == (None, None, None)


@pytest.mark.parametrize(
    "text",
    [
        "x_m;y_m\n1,5;2,25\n",
        "x_m\ty_m\r\n1,5\t2,25\r\n",
        "\ufeffx_m,y_m\n1.5,2.25\n",
        "x_m;y_m\n1.5;2.25\n",
        '"x_m","y_m"\n"1.5","2.25"\n\n\n',
        " x_m , y_m\n 1.5 , 2.25\n;".rstrip(";"),
    ],
)
def test_a_spreadsheet_of_any_country_is_read(text: str) -> None:
    assert places(text) == [(1.5, 2.25)]


def test_degrees_need_an_origin() -> None:
    text = "lat_deg,lon_deg,bearing_deg\n47.3769,8.5417,90\n"
    (visit,) = track(text, ZURICH).visits
    assert visit.xy == pytest.approx((0.0, 0.0), abs=1e-6)
    assert visit.heading == pytest.approx(0.0)
    with pytest.raises(InputError, match="positions are in degrees; give --origin LAT,LON,ALT,HEADING"):
        track(text)


def test_a_sorted_table_keeps_its_route() -> None:
    text = "number,id,x_m,y_m\n3,c,0,0\n1,a,5,5\n2,b,9,9\n"
    assert [visit.id for visit in track(text).visits] == ["a", "b", "c"]


def test_the_exports_table_comes_back_whole() -> None:
    mission = laboratory()
    made = read(exported(mission, "csv", Supplements()), "stops.csv", ImportOptions())
    assert made.start == mission.stops[0].approach[0]
    for visit, stop in zip(made.visits, mission.stops, strict=True):
        assert (visit.id, visit.xy, visit.via) == (stop.id, (stop.x, stop.y), stop.approach[1:-1])
        assert visit.heading == pytest.approx(math.remainder(stop.heading, math.tau))
        assert (visit.settle_s, visit.scan_s, visit.timeout_s) == (2.0, 60.0, 120.0)
        assert (visit.on_failure, visit.retries, visit.doorway) == ("ask", 1, False)


REFUSED = {
    "empty": ("", "holds no stop"),
    "only names": ("x_m,y_m\n", "holds no stop"),
    "unknown column": ("x_m,y_m,Höhe\n1,2,3\n", "column 'Höhe' is not known; known: x_m, y_m"),
    "column twice": ("x_m,y_m,x_m\n1,2,3\n", "column x_m occurs 2 times"),
    "no place": ("id\na\n", "has neither columns x_m, y_m nor lat_deg, lon_deg"),
    "half a place": ("x_m,y_m\n1,\n", "line 2: y_m is ''; every stop needs its position"),
    "a word": ("x_m,y_m\n1,2\neins,2\n", "line 3: x_m is 'eins'; it must be a number"),
    "a decimal comma in quotes": ('x_m,y_m\n"1,5",2\n', "line 2: x_m is '1,5'; it must be a number"),
    "thousands": ("x_m;y_m\n1,234.5;2\n", "x_m is '1,234.5'"),
    "both kinds of number": ("x_m;y_m\n1,5;2.5\n", "x_m is '1,5'"),
    "nan": ("x_m,y_m\nnan,2\n", "x_m is 'nan'"),
    "infinity": ("x_m,y_m\n1e999,2\n", "x_m is '1e999'"),
    "underscores": ("x_m,y_m\n1_000,2\n", "x_m is '1_000'"),
    "too many cells": ("x_m,y_m\n1,2,3\n", "line 2 has 3 cells, not 2"),
    "number twice": ("number,x_m,y_m\n1,1,2\n1,3,4\n", "number is '1'; it must be the stop's position"),
    "number missing": ("number,x_m,y_m\n,1,2\n", "number is ''"),
    "negative scan": ("x_m,y_m,scan_s\n1,2,-1\n", "scan_s is '-1'; it must be at least 0"),
    "half a retry": ("x_m,y_m,retries\n1,2,0.5\n", "retries is '0.5'; it must be a whole number"),
    "strange failure": ("x_m,y_m,on_failure\n1,2,cry\n", "on_failure is 'cry'; it must be one of retry"),
    "strange doorway": ("x_m,y_m,doorway\n1,2,ja\n", "doorway is 'ja'; it must be one of yes, no"),
    "bearing of nowhere": ("x_m,y_m,bearing_deg\n1,2,90\n", "bearing_deg is '90'; give --origin"),
    "leg elsewhere": ('x_m,y_m,approach_wkt\n1,2,"LINESTRING (0 0, 1 3)"\n', "it does not end at its stop"),
    "leg from elsewhere": (
        'x_m,y_m,approach_wkt\n0,0,\n1,2,"LINESTRING (5 0, 1 2)"\n',
        "line 3: approach_wkt is 'LINESTRING (5 0, 1 2)'; it does not begin at the stop before",
    ),
    "leg of nothing": ("x_m,y_m,approach_wkt\n1,2,LINESTRING EMPTY\n", "write LINESTRING (x y, x y)"),
    "leg in space": ('x_m,y_m,approach_wkt\n1,2,"LINESTRING (0 0 0, 1 2 0)"\n', "write LINESTRING"),
    "open quote": ('x_m,y_m\n"1,2\n', "not a table"),
    "zero byte": ("x_m,y_m\n1,2\0\n", "zero bytes"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_clear_is_refused_by_line_and_column(case: str) -> None:
    text, words = REFUSED[case]
    with pytest.raises(InputError) as refusal:
        track(text)
    assert str(refusal.value).startswith("stops.csv: ")
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_place_far_from_the_origin_is_refused() -> None:
    with pytest.raises(InputError, match="more than 10 km from the origin"):
        track("lat_deg,lon_deg\n48.5,8.5\n", ZURICH)


def test_text_that_is_no_utf_8_is_refused() -> None:
    with pytest.raises(InputError, match=r"not UTF-8 text \(byte 14\); save it as CSV UTF-8"):
        read("id,x_m,y_m\nBü,1,2\n".encode("utf-16-le")[:14] + b"\xd8", "s.csv", ImportOptions())

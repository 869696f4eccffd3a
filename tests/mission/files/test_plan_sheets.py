"""The set of sheets shows every place of the plan at a readable scale, and lists every stop once."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
import zlib

import numpy as np
import pytest
from msgspec import UNSET
from msgspec.structs import replace as changed

from stopgo.mission.document import MissionAllocation
from stopgo.mission.files import plan_sheets, plan_svg
from stopgo.mission.files.pdf import PdfPage, pdf_of
from stopgo.mission.files.plan_sheets import plan_pdf, rooms_of, sheets_of, tiles_of
from stopgo.mission.files.plan_svg import legs_of
from stopgo.mission.files.svg import SMALLEST_TEXT
from stopgo.mission.stages.figures import Figures, GroupCoverage, Unreached
from tests.mission.worlds import room_mission, room_route

DATE = "2026-11-22"
FIGURES = Figures(
    rule="length",
    whole=GroupCoverage("all", 24.0, 24.0, 24.0),
    rooms=(GroupCoverage("Büro 12", 24.0, 24.0, 24.0),),
    kinds=(GroupCoverage("walls", 24.0, 24.0, 24.0),),
    rooms_m2=32.0,
    reached_m2=32.0,
    unreached=(Unreached(room="Lager", area_m2=9.0, why="door-7 is 0.60 m wide"),),
    findings=(),
)


@pytest.fixture(autouse=True)
def _small_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A room of 8 m by 4 m needs several sheets at 1:20."""
    monkeypatch.setattr(plan_sheets, "READABLE", 20)


def sheets() -> tuple[list[PdfPage], dict[str, str]]:
    return sheets_of(room_route(), room_mission(), FIGURES, date=DATE)


def words(page: PdfPage) -> list[str]:
    return [item.text or "" for item in ET.fromstring(f"<g>{page.content}</g>").iter("text")]


def streams(pdf: bytes) -> list[bytes]:
    """The drawings in the file, of pages and shared ones."""
    begins = re.finditer(rb"/Length (\d+)\s*>>\s*stream\r?\n", pdf)
    return [zlib.decompress(pdf[at.end() : at.end() + int(at[1])]) for at in begins]


def test_the_same_plan_gives_the_same_bytes() -> None:
    once = plan_pdf(room_route(), room_mission(), FIGURES, date=DATE)
    assert once == plan_pdf(room_route(), room_mission(), FIGURES, date=DATE)
    assert once.startswith(b"%PDF")


def test_every_place_of_the_plan_is_on_a_sheet() -> None:
    route, mission = room_route(), room_mission()
    tiles = tiles_of(route, mission)
    assert len(tiles) > 1
    assert len({tile.name for tile in tiles}) == len(tiles)
    places = [*route.visibility.targets.unit_xy.tolist(), *((s.x, s.y) for s in mission.stops)]
    assert all(any(tile.holds(x, y) for tile in tiles) for x, y in places)


def test_one_mission_of_several_has_the_sheets_that_its_route_leads_through() -> None:
    route, mission = room_route(), room_mission()
    first = changed(mission, stops=mission.stops[:1], return_=UNSET, share=MissionAllocation("tour", 1, 2))
    tiles, way = tiles_of(route, mission), legs_of(first)
    pages, _ = sheets_of(route, first, FIGURES, date=DATE)
    kept = [page.name.removeprefix("Sheet ") for page in pages if page.name.startswith("Sheet ")]
    assert 0 < len(kept) < len(tiles)
    assert all(any(tile.holds(x, y) for tile in tiles if tile.name in kept) for leg in way for x, y in leg)


def test_what_the_sheets_of_missions_have_in_common_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    route, mission, drawn = room_route(), room_mission(), []
    each = [
        changed(mission, stops=mission.stops[k:][:1], share=MissionAllocation("tour", 1, 2)) for k in (0, 1)
    ]
    alone = [plan_pdf(route, item, FIGURES, date=DATE) for item in each]
    building = plan_svg.building
    monkeypatch.setattr(plan_svg, "building", lambda *given: drawn.append(given) or building(*given))
    floors = plan_svg.FloorsOnPaper(several=True)
    assert [plan_pdf(route, item, FIGURES, date=DATE, floors=floors) for item in each] == alone
    assert len(drawn) == 2, "for the overview, and for the sheets"


def test_a_drawing_of_one_mission_is_made_once_for_each_map_to_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    route, mission, drawn = room_route(), room_mission(), []
    alone = plan_svg.overview(route, mission, date=DATE), plan_pdf(route, mission, FIGURES, date=DATE)
    network = plan_svg.network
    monkeypatch.setattr(plan_svg, "network", lambda *given: drawn.append(given) or network(*given))
    floors = plan_svg.FloorsOnPaper(several=False)
    for _ in range(2):
        picture = plan_svg.overview(route, mission, date=DATE, floors=floors)
        assert (picture, plan_pdf(route, mission, FIGURES, date=DATE, floors=floors)) == alone
    assert len(drawn) == 4, "that of the sheets, with some of the names, is made each time"


def test_neighbouring_sheets_share_a_strip() -> None:
    first, second = tiles_of(room_route(), room_mission())[:2]
    assert first.high[0] - second.low[0] == pytest.approx(plan_sheets.OVERLAP * 20 / 1000)


def test_a_sheet_says_which_of_how_many_it_is_and_shows_the_drawing_through_its_window() -> None:
    pages, shared = sheets()
    assert shared.keys() == {"site", "key", "legend"}
    assert [words(page)[-1] for page in pages] == [
        f"sheet {n} of {len(pages)}" for n in range(1, len(pages) + 1)
    ]
    tiles = [page for page in pages if page.name.startswith("Sheet ")]
    uses = [{use.group(1) for use in re.finditer('href="#([a-z]+)"', page.content)} for page in tiles]
    assert uses == [shared.keys()] * len(tiles)
    assert all("1:20 on A3 landscape" in words(page) for page in tiles)


def test_every_stop_is_listed_once_with_its_room_sheet_and_a_box_to_tick() -> None:
    pages, _ = sheets()
    (listed,) = [page for page in pages if page.name == "Stops"]
    for stop, room in zip(
        room_mission().stops,
        rooms_of(room_mission(), room_route().floor),
        strict=True,
    ):
        assert words(listed).count(stop.id) == 1
        assert room in words(listed)
    assert listed.content.count("<rect") == len(room_mission().stops)


def test_rooms_left_out_are_reported() -> None:
    pages, _ = sheets()
    assert "Lager (9.0 m²): door-7 is 0.60 m wide" in words(pages[-1])


def test_no_text_is_too_small_to_read() -> None:
    pages, shared = sheets()
    for content in (*(page.content for page in pages), *shared.values()):
        sizes = [float(size) for size in re.findall(r'font-size="([\d.]+)"', content)]
        assert min(sizes, default=SMALLEST_TEXT) >= 2.5


def test_a_millimetre_is_a_millimetre_in_the_pdf() -> None:
    page = PdfPage(100.0, 50.0, '<path d="M10 20L30 40" stroke="#000" stroke-width="0.5" fill="none"/>')
    pdf = pdf_of([page], title="t")
    assert b"/MediaBox [ 0 0 283.4646 141.7323 ]" in pdf
    (drawn,) = streams(pdf)
    assert b"2.834646 0 0 -2.834646 0 141.7323 cm" in drawn
    assert b"10 20 m 30 40 l" in drawn


def test_relative_steps_and_turned_words_are_understood() -> None:
    content = (
        '<g fill="none" stroke="#fff"><path d="M1 2l3 4l-1 0Z"/></g>'
        '<text x="5" y="6" font-size="3" transform="rotate(-90 5 6)" text-anchor="middle">Zähler</text>'
    )
    (drawn,) = streams(pdf_of([PdfPage(50.0, 50.0, content)], title="t"))
    assert b"1 2 m 4 6 l 3 6 l h" in drawn
    assert b"Z\\344hler" in drawn
    assert b"0 -1 -1 0 5 6 cm" in drawn


def test_a_halo_lies_beneath_its_words_and_brackets_are_escaped() -> None:
    content = '<text x="0.5" y="-6.25" font-size="3" fill="#000" stroke="#fff">(3 m²) …</text>'
    (drawn,) = streams(pdf_of([PdfPage(50.0, 50.0, content)], title="t"))
    assert b"1 0 0 -1 .5 -6.25 cm" in drawn
    words = rb"(\(3 m\262\) \205) Tj T*"
    assert drawn.index(b"Tm 1 Tr " + words + b" 0 Tr ET") < drawn.index(b"Tm " + words + b" ET")


def test_a_shape_is_stroked_and_filled_as_its_style_says() -> None:
    looks = ('fill="none" stroke="#000"', 'fill="#fff" fill-rule="evenodd"', 'fill="#fff" stroke="#000"')
    content = "".join(f'<path d="M1 2L3 4L5 6Z" {look}/>' for look in looks)
    (drawn,) = streams(pdf_of([PdfPage(50.0, 50.0, content)], title="t"))
    assert re.findall(rb"5 6 l h\n(\S+)", drawn) == [b"S", b"f*", b"B"]


def test_letters_of_any_script_are_written_or_replaced() -> None:
    content = '<text x="5" y="6" font-size="3">Кабинет 会議室</text>'
    assert pdf_of([PdfPage(50.0, 50.0, content)], title="Кабинет").startswith(b"%PDF")


def test_what_is_drawn_through_a_window_is_cut_at_it() -> None:
    pages, shared = sheets()
    drawn = streams(pdf_of(pages, title="t", shared=shared))
    assert sum(re.search(rb"W\*? n", body) is not None for body in drawn) == 1 + sum(
        page.name.startswith("Sheet ") for page in pages
    )
    assert np.isfinite([page.width for page in pages]).all()

"""No text of the page is smaller than 11 px on a screen of 360 px, or 2.5 mm on A4."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from stopgo.recordings.page import report_html
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.plots import WIDTH
from stopgo.recordings.page.reviewed import review
from stopgo.recordings.page.style import STYLE

MM_PER_PX = 25.4 / 96
PAPER_MM = 170.0


@pytest.fixture(scope="module")
def page(sighted: Path, skipping: Path) -> str:
    return report_html(subject_of(review([sighted, skipping]))).decode()


def test_the_texts_of_the_plan_are_readable_on_screen_and_paper(page: str) -> None:
    style, view, body = (
        re.search(r'<svg[^>]*class="plan"[^>]*>', page),
        re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*aria-label', page),
        page,
    )
    assert style is not None and view is not None
    width, height = map(float, view.groups())
    least_px = float(re.search(r"min-width:([\d.]+)px", style.group()).group(1))  # type: ignore[union-attr]
    plan = body[style.start() : body.index("</svg>", style.start())]
    sizes = [float(size) for size in re.findall(r'font-size="([\d.]+)"', plan)]
    assert len(sizes) >= 4
    assert min(sizes) / width * least_px >= 10.95
    assert min(sizes) / max(width, height) * PAPER_MM >= 2.49


def test_all_other_texts_are_large_enough(page: str) -> None:
    screen, paper = STYLE.split("@media print")
    assert (
        min(float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)px", screen.split("@page")[0])) >= 11
    )
    assert min(float(size) for size in re.findall(r"font-size: ([\d.]+)px", paper)) * MM_PER_PX >= 2.5
    wide_mm = float(re.search(r"\.plots svg \{ width: (\d+)mm", paper).group(1))  # type: ignore[union-attr]
    assert 11 / WIDTH * wide_mm >= 2.5
    assert "counter(page)" in STYLE


def test_what_is_wider_than_a_phone_scrolls_in_its_own_box(page: str) -> None:
    assert ".plots figure, .columns section { max-width: 100%; overflow-x: auto; }" in STYLE
    open_boxes: list[str] = []
    for tag in re.finditer(r"<(/?)(div|section|figure|table|svg)([^>]*)>", page):
        closes, name, about = tag.groups()
        wide = name == "table" or (name == "svg" and 'class="plan"' in about)
        if closes:
            open_boxes.pop()
            continue
        scrolls = any('class="scroll"' in box or box.startswith("section") for box in open_boxes)
        assert scrolls or not wide, page[tag.start() - 200 : tag.start()]
        open_boxes.append(name + about)

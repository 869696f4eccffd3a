"""report.html: one file that needs nothing next to it, holds what was computed, and lets no text act."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.floor.polylines import FloorLines
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.run.events import Finished, Paused, Resumed, Skipped
from stopgo.mission.run.run_log import Alignment
from stopgo.recordings.page import report_html
from stopgo.recordings.page.floor_picture import plan_picture
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import review
from stopgo.recordings.page.runs_together import run_names, when_and_who
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.page.words import number, row, shown
from tests.mission.comparing.reports import told
from tests.mission.comparing.test_compare import START, planned, run, visit
from tests.recordings.run import BEGAN_NS

NASTY = '<script>alert(1)</script> "&\x1b[31m\x00'


def tree(page: bytes) -> ElementTree.Element:
    """The page's body; it is written so that it is XML too."""
    text = page.decode()
    return ElementTree.fromstring(text[text.index("<body>") : text.index("</body>") + len("</body>")])


def words(page: bytes) -> str:
    return " ".join(" ".join(tree(page).itertext()).split())


def skipping() -> ReportSubject:
    mission, sight = planned()
    events = (
        *visit("S1", 0, 1, 1),
        (Paused, 64.0, {"reason": NASTY}),
        (Resumed, 80.0, {"commander": "ann"}),
        (Skipped, 85.0, {"stop": "S2", "reason": NASTY}),
        (Finished, 90.0, {}),
    )
    log = told(mission, START, *events, poses=[(0, 1, 1), (70, 2, 1.01), (85, 3.2, 1)])
    return ReportSubject((mission,), (compare(log, [mission], [sight]),), sight)


def test_a_run_reports_its_verdict_and_every_figure() -> None:
    subject = skipping()
    text = words(report_html(subject))
    assert "Not acquired. 57.1 % of what is visible was scanned; 70.0 % was required, 78.5 % planned." in text
    assert "stops scanned 1 / 2" in text
    assert "lost %" in text and " 21.4 " in text
    assert "greatest cross-track error 10.0 mm" in text
    assert "stationary 0:16 paused 1, held 0" in text


def test_a_gap_in_the_poses_is_dashed_and_reported() -> None:
    mission, sight = planned()
    path = [(k * 0.5, 1, 1) for k in range(20)] + [(40 + k * 0.5, 3.2, 1) for k in range(100)]
    log = told(
        mission, START, *visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1), (Finished, 133.0, {}), poses=path
    )
    subject = ReportSubject((mission,), (compare(log, [mission], [sight]),), sight)
    page = report_html(subject)
    assert (
        "no poses for 0:30 from 0:10: 2.2 m of the path unseen, from (1.00, 1.00) to (3.20, 1.00)"
        in words(page)
    )
    driven, gap = (
        next(
            item
            for item in tree(page).iter("path")
            if item.get("stroke") == "#CC79A7" and item.get("stroke-dasharray") == dash
        )
        for dash in (None, "3 4")
    )
    assert gap.get("d") is not None
    assert driven.get("d") is not None


def test_a_run_has_its_date_and_its_robot() -> None:
    subject = skipping()
    (comparison,) = subject.comparisons
    dated = tuple(
        msgspec.structs.replace(event, robot_ns=BEGAN_NS + event.robot_ns % 10**15)
        for event in comparison.log.events
    )
    log = replace(comparison.log, events=dated, robot="r1")
    page = words(report_html(replace(subject, comparisons=(replace(comparison, log=log),))))
    assert re.search(r"2026-11-\d\d \d\d:\d\d UTC, robot r1", page)
    old = replace(log, events=tuple(msgspec.structs.replace(event, robot_ns=5) for event in dated))
    page = words(report_html(replace(subject, comparisons=(replace(comparison, log=old),))))
    assert "date unknown" in page


def test_the_plan_has_a_scale_bar_and_true_north() -> None:
    """The site's +y axis points east: north is to the left."""
    subject = skipping()
    (comparison,) = subject.comparisons
    site = SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=90.0)
    mission = msgspec.structs.replace(comparison.mission, georeference=site)
    drawn = plan_picture(subject, replace(comparison, missions=(mission,)))
    assert re.search(r">\d+ m</text>", drawn)
    tip, left, right = re.findall(r"[ML]([\d.]+) ([\d.]+)", drawn[: drawn.index("<title>true north")])[-3:]
    assert float(tip[0]) < float(left[0]) == float(right[0])
    assert float(left[1]) != float(right[1])
    assert "true north" not in plan_picture(subject, comparison)


def test_a_bar_marks_the_required_coverage() -> None:
    mission, sight = planned()
    asked = replace(sight, totals=replace(sight.totals, kind_required=0.7))
    page = report_html(ReportSubject((mission,), (), asked)).decode()
    assert '<i style="left:70.0%"></i>' in page


def test_a_plan_alone_has_a_page() -> None:
    mission, sight = planned()
    text = words(report_html(ReportSubject((mission,), sight=sight)))
    assert "Planned. 78.5 % of what is visible will be scanned; 70.0 % is required." in text
    assert "stops 2" in text


def test_several_runs_stand_in_columns() -> None:
    whole = run(*visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1), (Finished, 133.0, {}))
    subject = skipping()
    both = replace(subject, comparisons=(*subject.comparisons, whole))
    page = tree(report_html(both))
    (table, *_) = page.iter("table")
    rows = [["".join(cell.itertext()) for cell in line] for line in table.iter("tr")]
    assert ["verdict", "Not acquired", "Acquired"] in rows
    assert ["coverage", "57.1 %", "78.5 %"] in rows


def test_runs_are_named_by_date_and_robot_and_numbered_within_a_minute() -> None:
    whole = run(*visit("S1", 0, 1, 1), *visit("S2", 70, 3.2, 1), (Finished, 133.0, {}))
    (first,) = skipping().comparisons
    one, two = (replace(item, log=replace(item.log, robot="r7")) for item in (first, whole))
    names = run_names([one, two])
    assert [
        name.endswith(f"robot r7 (run {number})") for name, number in zip(names, (1, 2), strict=True)
    ] == [
        True,
        True,
    ]
    assert run_names([one]) == [when_and_who(one)]


def test_text_from_outside_stays_text(mission: Mission) -> None:
    subject = skipping()
    nasty = with_digest(msgspec.structs.replace(subject.mission, name=NASTY))
    page = report_html(replace(subject, missions=(nasty,), problems=(NASTY,)))
    assert b"<script" not in page
    assert not re.search(rb"[\x00-\x08\x0b-\x1f]", page)
    assert "<script>alert(1)</script>" in words(page)


def test_nothing_is_fetched_and_nothing_runs() -> None:
    page = report_html(skipping()).decode()
    assert not re.findall(r"\bsrc=|href=|url\(|@import|https?:", page)
    assert "default-src 'none'" in page


def test_the_same_subject_gives_the_same_page() -> None:
    assert report_html(skipping()) == report_html(skipping())


def test_what_was_lost_is_thicker_than_what_was_seen_and_what_is_missing_has_a_shape_of_its_own() -> None:
    page = tree(report_html(skipping()))
    paths = [item.attrib for item in page.iter("path") if "stroke-width" in item.attrib]
    width = {item["stroke"]: float(item["stroke-width"]) for item in paths if "vector-effect" in item}
    assert width["#D55E00"] > width["#0072B2"]
    names = {item.findtext("title") for item in page.iter("rect")}
    assert names == {"S2 skipped"}


def test_alignment_and_losses_of_a_log_are_reported() -> None:
    subject = skipping()
    (comparison,) = subject.comparisons
    fit = Alignment("fitted to 2 stops", 1.0, 2.0, 0.1, residual_rms_m=0.012, residual_max_m=0.02, pairs=2)
    source = replace(comparison.log.source, name="robot.bag", format="rosbag", messages=9, lost=3)
    log = replace(comparison.log, alignment=fit, source=source)
    text = words(report_html(replace(subject, comparisons=(replace(comparison, log=log),))))
    assert "fitted to 2 stops: rotated by 5.730°, shifted by (1.000, 2.000) m" in text
    assert "residuals of 2 pairs: 12.0 mm rms, 20.0 mm at most" in text
    assert "robot.bag (rosbag): 9 messages read, 3 lost" in text


def test_a_command_writes_it_from_recordings(sighted: Path, skipping: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    assert main(["review", str(sighted), str(skipping), "--html", str(page)]) == 1
    text = words(page.read_bytes())
    assert "Room 1" in text
    assert "narrow_door" in text or "Findings" not in text
    subject = subject_of(review([sighted, skipping]))
    assert judge(subject.comparisons[0]).text in text
    assert subject.floor is not None
    assert len(subject.floor.kinds["walls"]) == 5


def test_recordings_of_two_missions_are_no_one_report(
    sighted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = review([sighted])
    (item,) = found.recordings
    known = item.recording.contents.properties
    properties = known | {"plan": known["plan"] | {"mission_id": "f" * 32}}
    contents = replace(item.recording.contents, properties=properties)
    other = replace(item, recording=replace(item.recording, contents=contents))
    with pytest.raises(Exception, match="needs recordings of one mission"):
        subject_of(replace(found, recordings=(item, other)))


def test_numbers_have_one_minus_and_none_before_zero() -> None:
    assert (number(-0.04, sign=True), number(-1.26, sign=True), number(None)) == ("+0.0", "−1.3", "")
    assert shown('<a b="c">') == "&lt;a b=&quot;c&quot;&gt;"


def test_a_name_is_left_out_where_its_room_has_no_space_for_a_readable_one() -> None:
    mission, sight = planned()
    ring = np.array([(0, 0), (8, 0), (8, 6), (0, 6), (0, 0)], dtype=float)
    long, endless = "a name that is quite long, yet not too long", "x" * 400
    names = tuple((name, 4.0, 5.0 - row) for row, name in enumerate(("hall", long, endless, "")))
    floor = FloorLines((ring,), (ring,), {}, (), names)
    page = tree(report_html(ReportSubject((mission,), sight=sight, floor=floor)))
    texts = [item for item in page.iter("text") if item.get("fill") == "#5a5e66"]
    sizes = {item.text: float(item.attrib["font-size"]) for item in texts}
    assert sizes["hall"] == pytest.approx(2.5 / 170 * 8 * 1.04, rel=1e-2)
    assert sizes.get(long, sizes["hall"]) == sizes["hall"]
    assert endless not in sizes


def test_a_number_and_its_limit_are_aligned_alike() -> None:
    assert row(["7.3 mm", "≤ 7.1 mm", "at most 7"]) == (
        '<tr><td class="number">7.3 mm</td><td class="number">≤ 7.1 mm</td><td>at most 7</td></tr>'
    )

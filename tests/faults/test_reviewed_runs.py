"""Runs with everything going wrong, as `review` and `watch` report them: each figure is the simulator's.

Terminal, JSON and page are read as they are shown, and compared with what a witness next to the robot saw.
"""

from __future__ import annotations

import html
import json
import math
import random
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from stopgo.command_line import main
from stopgo.mission.comparing.compare import arrival_direction
from stopgo.mission.comparing.comparison import COLUMNS
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.console.table import duration
from stopgo.mission.document import Mission, Stop, with_digest
from stopgo.mission.document.schedule import schedule
from stopgo.mission.geometry import frozen
from stopgo.mission.run.events import Held, RevisionTaken
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.sight import SeenFrom, Sight
from stopgo.recordings.embedded import reading
from stopgo.recordings.plan import PlanRecording
from tests.faults.sizes import size
from tests.mission.comparing.test_compare import planned
from tests.recordings.replay.driving import wandering
from tests.recordings.replay.witnessed import Troubles, Witness, run_of, tell, troubles_of

SEEDS = range(size(short=1, full=100))
NS = 2e-9
UM = 1e-6
ROUNDED = 0.0501
"""A figure with one decimal."""


@dataclass(frozen=True)
class Story:
    """A run, its revisions, what their stops see, and the truth of it."""

    missions: tuple[Mission, ...]
    """Those that the robot followed."""
    sights: tuple[Sight, ...]
    witness: Witness

    @property
    def stops(self) -> list[Stop]:
        """Those of the last revision, and then those that it withdrew."""
        found = {stop.id: stop for mission in reversed(self.missions) for stop in mission.stops}
        return list(found.values())

    def scanned(self, stop: Stop) -> bool:
        return any(shot.good for shot in self.witness.shots_at(stop))

    def outcome(self, stop: Stop) -> set[str]:
        """Allowed verdicts."""
        if self.scanned(stop):
            return {"scanned"}
        withdrawn = stop.id not in {item.id for item in self.missions[-1].stops}
        return {"withdrawn"} if withdrawn else {"skipped", "failed"}

    def sees(self, stop: Stop) -> set[int]:
        """The visible units that a stop sees."""
        visible = self.sights[-1].totals.visible
        units = self.sights[-1].views_from([stop.id])
        return set(np.flatnonzero(visible & (units > 0)).tolist())

    @property
    def seen(self) -> set[int]:
        return {unit for stop in self.stops if self.scanned(stop) for unit in self.sees(stop)}

    def share(self, units: set[int], among: set[int] | None = None) -> float:
        """Of what is visible, or of those among it."""
        totals = self.sights[-1].totals
        visible = set(np.flatnonzero(totals.visible).tolist())
        asked = visible if among is None else visible & among
        return sum(int(totals.weight[unit]) for unit in units & asked) / sum(
            int(totals.weight[unit]) for unit in asked
        )


def story_of(seed: int, folder: Path) -> Story:
    """A run of 4 stops in which links fall silent, and a revision drops a stop or adds one."""
    chance = random.Random(seed + 20_000)
    whole = wandering(seed, stops=5, scan_s=8.0)
    policy = replace(whole.policy, link_loss="hold", link_loss_after_s=30.0)
    mission = with_digest(replace(whole, stops=whole.stops[:4], policy=policy))
    stops = whole.stops[: 5 if chance.random() < 0.5 else 3]
    revised = with_digest(replace(mission, stops=stops, revision=2))
    troubles = troubles_of(seed, mission)
    changes = (chance.uniform(5, 40), revised) if chance.random() < 0.7 else None
    troubles = Troubles(
        troubles.faults,
        troubles.pauses,
        troubles.skips,
        silences=tuple(chance.uniform(5, 60) for _ in range(chance.randrange(3))),
        revised=changes,
    )
    witness = run_of(mission, troubles, folder, seed=seed)
    taken = any(isinstance(event, RevisionTaken) for event in witness.events)
    missions = (mission, revised) if taken else (mission,)
    return Story(missions, tuple(_sight(item, seed) for item in missions), witness)


def _sight(mission: Mission, seed: int) -> Sight:
    """Each stop sees one stretch of the small world's targets, the same in every revision."""
    known = planned()[1]
    chance = random.Random(seed)
    runs = [sorted(chance.sample(range(len(known.totals.weight)), 2)) for _ in range(5)]
    runs = runs[: len(mission.stops)]
    return Sight(
        mission.id,
        mission.revision,
        mission.digest,
        known.targets,
        known.totals,
        tuple(SeenFrom(stop.id, stop.x, stop.y) for stop in mission.stops),
        frozen(np.arange(len(runs) + 1), np.int64),
        frozen([first for first, _ in runs], np.int64),
        frozen([last for _, last in runs], np.int64),
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_review_and_watch_report_the_truth_of_each_figure(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "fatal_faults", lambda paths: {})  # what is recorded here needs no other
    story = story_of(seed, tmp_path)
    files = [str(tmp_path / "field.rrd"), *_plans(story, tmp_path)]
    page = tmp_path / "report.html"
    code = main(["review", "--json", "--html", str(page), *files])
    told = json.loads(capsys.readouterr().out)
    assert main(["review", *files]) == code
    (run,) = told["recordings"][0]["runs"]
    _is_true_of_run(story, run)
    _is_true_in_text(story, capsys.readouterr().out)
    _is_true_on_page(story, page.read_text())
    heard = RunCollector(sights=story.sights)
    tell(heard, story.missions, story.witness)
    compared = heard.compared()
    assert compared is not None
    _is_true_of_run(story, comparison_json(compared))
    _is_true_in_text(story, comparison_text(compared))


def _plans(story: Story, folder: Path) -> list[str]:
    paths = []
    for mission, sight in zip(story.missions, story.sights, strict=True):
        recording = PlanRecording(mission.id)
        recording.observe(mission)
        recording.observe(sight)
        paths.append(folder / f"plan-{mission.revision}.rrd")
        recording.write(paths[-1])
    return list(map(str, paths))


# ---- JSON ----


def _is_true_of_run(story: Story, run: dict[str, Any]) -> None:
    witness, last = story.witness, story.missions[-1]
    assert run["revisions"] == [mission.revision for mission in story.missions]
    assert run["scanned"] == sum(map(story.scanned, story.stops))
    assert run["asked"] == len(last.stops)
    assert run["planned_s"] == pytest.approx(schedule(last).total_s)
    assert run["driven_s"] == pytest.approx(witness.seconds(witness.ended_ns), abs=NS)
    assert run["paused_s"] == pytest.approx(witness.stood_s("pause"), abs=NS)
    assert run["held_s"] == pytest.approx(witness.stood_s("held"), abs=NS)
    holds = [event for event in witness.events if isinstance(event, Held)]
    assert sum(item["state"] == "HELD" for item in run["states"]) == len(holds)
    assert run["travelled_m"] == pytest.approx(witness.length_m, rel=0.002, abs=0.02 + 300 * witness.shakes_m)
    _is_true_of_coverage(story, run["coverage"])
    assert [item["stop"] for item in run["stops"]] == [stop.id for stop in story.stops]
    for stop, item in zip(story.stops, run["stops"], strict=True):
        _is_true_of_stop(story, stop, item)
    away = [item["deviation_m"] for item in run["stops"] if item["deviation_m"] is not None]
    assert run["greatest_deviation_m"] == max(away, default=None)


def _is_true_of_coverage(story: Story, told: dict[str, Any]) -> None:
    totals = story.sights[-1].totals
    assert told["acquired"] == pytest.approx(story.share(story.seen))
    names = {
        "rooms": [(group.name, totals.room == k) for k, group in enumerate(totals.rooms)],
        "kinds": [
            (kind, np.isin(totals.element, [k for k, one in enumerate(totals.elements) if one.kind == kind]))
            for kind in {element.kind for element in totals.elements}
        ],
    }
    for what, groups in names.items():
        among = {name: set(np.flatnonzero(mask).tolist()) for name, mask in groups}
        for item in told[what]:
            if item["visible"] and item["name"] in among:
                assert item["acquired"] == pytest.approx(story.share(story.seen, among[item["name"]]))


def _is_true_of_stop(story: Story, stop: Stop, told: dict[str, Any]) -> None:
    witness = story.witness
    arrivals, shots = witness.arrivals(stop), witness.shots_at(stop)
    good = [shot for shot in shots if shot.good]
    assert told["outcome"] in story.outcome(stop), told
    assert bool(told["reason"]) == (told["outcome"] in ("skipped", "failed"))
    assert told["tries"] == len(shots)
    assert told["lost"] == (None if told["outcome"] == "scanned" else pytest.approx(_lost(story, stop)))
    assert told["planned_s"] in [pytest.approx(when) for when in _plans_of(story, stop)]
    first = witness.seconds(arrivals[0][0]) if arrivals else None
    assert told["arrived_s"] == pytest.approx(first, abs=NS)
    if first is not None:
        assert told["late_s"] == pytest.approx(first - told["planned_s"])
        _is_true_of_place(story, stop, (good[-1].pose if good else arrivals[-1][1]), told, good=bool(good))


def _is_true_of_place(story: Story, stop: Stop, pose: Any, told: dict[str, Any], *, good: bool) -> None:
    near = UM if good else UM + 2 * story.witness.shakes_m
    x, y, ahead = pose.x - stop.x, pose.y - stop.y, arrival_direction(stop)
    assert told["along_m"] == pytest.approx(x * math.cos(ahead) + y * math.sin(ahead), abs=near)
    assert told["across_m"] == pytest.approx(y * math.cos(ahead) - x * math.sin(ahead), abs=near)
    assert told["deviation_m"] == pytest.approx(math.hypot(x, y), abs=near)
    assert told["heading_rad"] == pytest.approx(math.remainder(pose.heading - stop.heading, math.tau), abs=UM)


def _lost(story: Story, stop: Stop) -> float | None:
    """A stop that the last revision has not is missing nowhere."""
    known = stop.id in story.sights[-1].ids
    return story.share(story.sees(stop) - story.seen) if known else None


def _plans_of(story: Story, stop: Stop) -> list[float]:
    return [
        schedule(mission).arrival_s[[item.id for item in mission.stops].index(stop.id)]
        for mission in story.missions
        if stop.id in {item.id for item in mission.stops}
    ]


# ---- terminal ----


def _is_true_in_text(story: Story, text: str) -> None:
    lines = [re.split(r"\s{2,}", line.strip()) for line in text.splitlines()]
    rows = {cells[0]: dict(zip(COLUMNS, cells, strict=False)) for cells in lines if len(cells) >= 11}
    for stop in story.stops:
        _is_true_of_cells(story, stop, rows[stop.id])
    scanned = sum(map(story.scanned, story.stops))
    assert f"{scanned} of {len(story.missions[-1].stops)} stops scanned" in text
    assert f"driven {duration(story.witness.seconds(story.witness.ended_ns))}" in text
    assert f"{percent(story.share(story.seen))} of what is visible was scanned" in text
    stood = story.witness.stood_s("pause") + story.witness.stood_s("held")
    assert (f"paused or held {duration(stood)}" in text) == bool(stood)


def _is_true_of_cells(story: Story, stop: Stop, cells: dict[str, str]) -> None:
    arrivals = story.witness.arrivals(stop)
    assert cells["outcome"] in story.outcome(stop)
    assert int(cells["tries"]) == len(story.witness.shots_at(stop))
    first = story.witness.seconds(arrivals[0][0]) if arrivals else None
    assert _value(cells["arrived s"]) == pytest.approx(first, abs=ROUNDED)
    lost = None if story.scanned(stop) else _lost(story, stop)
    assert _value(cells["lost %"]) == (None if lost is None else pytest.approx(100 * lost, abs=ROUNDED))


def _value(cell: str) -> float | None:
    return None if cell in ("-", "") else float(cell.replace("−", "-").replace("%", "").strip())


# ---- page ----


def _is_true_on_page(story: Story, page: str) -> None:
    witness = story.witness
    tiles = re.sub(r"<[^>]+>", " ", page)
    scanned = sum(map(story.scanned, story.stops))
    assert f"{scanned} / {len(story.missions[-1].stops)}" in tiles
    assert percent(story.share(story.seen)) in tiles
    assert duration(witness.seconds(witness.ended_ns)) in tiles
    assert duration(witness.stood_s("pause") + witness.stood_s("held")) in tiles
    rows = {cells[0]: cells for cells in _rows(page) if len(cells) == 11}
    for stop in story.stops:
        cells, arrivals = rows[stop.id], witness.arrivals(stop)
        assert cells[1].partition(":")[0] in story.outcome(stop)
        assert cells[3] == (duration(witness.seconds(arrivals[0][0])) if arrivals else "")
        assert cells[9] == str(len(witness.shots_at(stop)))
        lost = None if story.scanned(stop) else _lost(story, stop)
        got = _value(cells[10])
        assert got == (None if lost is None else pytest.approx(-100 * lost, abs=ROUNDED))


def _rows(page: str) -> list[list[str]]:
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page, re.DOTALL)
    return [[_plain(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL)] for row in rows]


def _plain(cell: str) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", cell)).strip()

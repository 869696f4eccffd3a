"""Verdicts on logs with a known truth: none is false, and few logs that can decide are undecided."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.faults.sizes import size
from tests.recordings.truth.auto_logs import auto_answers
from tests.recordings.truth.bench import answered, cases
from tests.recordings.truth.cloud_cases import cloud_answers, small_floor
from tests.recordings.truth.own_runs import own_answers, recorded_answers

PARTS = 4
"""The cases are dealt out among so many tests, which run side by side."""
MOST_UNTOLD = 0.1
"""Greatest fraction of decidable cases that stays undecided; the short form may leave one of its few."""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("part", range(PARTS))
def test_no_verdict_on_a_log_is_false(part: int, tmp_path: Path) -> None:
    every = size(short=47, full=1)
    chosen = list(cases())[part :: PARTS * every]
    found = []
    for number, case in enumerate(chosen):
        folder = tmp_path / str(number)
        folder.mkdir()
        found.append(answered(case, folder))
    assert [(item.case.name, item.kind, item.text) for item in found if item.kind.startswith("false")] == []
    counts = Counter(item.kind for item in found)
    most = MOST_UNTOLD * (counts["untold"] + counts["right"])
    assert counts["untold"] <= (most if every == 1 else max(most, 1))


@pytest.mark.parametrize("part", range(PARTS))
def test_no_verdict_on_a_log_of_an_autopilots_own_run_is_false(part: int, tmp_path: Path) -> None:
    every = size(short=37, full=1)
    found = list(auto_answers(tmp_path, every=PARTS * every, first=part * every))
    assert [(item.name, item.text) for item in found if item.kind.startswith("false")] == []
    if every == 1:
        counts = Counter(item.kind for item in found)
        assert counts["untold"] <= MOST_UNTOLD * (counts["untold"] + counts["right"])


def test_no_verdict_on_clouds_is_false(tmp_path: Path) -> None:
    found = list(cloud_answers(small_floor(tmp_path)))
    assert [(item.name, item.text) for item in found if item.kind != "right"] == []


def test_no_verdict_on_a_run_of_our_own_robot_is_false() -> None:
    found = [answer for seed in range(1, 1 + size(short=1, full=10)) for answer in own_answers(seed)]
    assert [(item.name, item.text) for item in found if item.kind not in ("right", "open")] == []
    assert {item.answer for item in found} == {"yes", "no", "unknown"}


def test_no_verdict_on_a_recording_of_such_a_run_is_false(tmp_path: Path) -> None:
    found = list(recorded_answers(tmp_path, every=size(short=27, full=1)))
    assert [(item.name, item.text) for item in found if item.kind.startswith("false")] == []

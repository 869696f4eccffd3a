"""Packets are lost, late and out of order below TCP, on a line between two network stacks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.sizes import FULL, some

STOPS = ("s1", "s2", "s3")
EVENTS = [f"{what} {stop}" for stop in STOPS for what in ("Arrived", "Settled", "Scanned")]
RUN = ["Started", *EVENTS, "Homing", "Finished"]
LINES = {
    "a fifth lost, 10 ms": (0.2, 0.01, 0.0),
    "256 kbit/s, 80 ms, a fiftieth lost": (0.02, 0.08, 256e3),
} | (
    {
        "1 Mbit/s, 80 ms, a twentieth lost": (0.05, 0.08, 1e6),
        "three tenths lost, 50 ms": (0.3, 0.05, 0.0),
        "a tenth lost, 10 ms": (0.1, 0.01, 0.0),
        "three tenths lost, 10 ms": (0.3, 0.01, 0.0),
    }
    if FULL
    else {}
)
"""Share of packets lost, mean delay in seconds, and bits per second (0: no limit)."""


@pytest.mark.skipif(not (shutil.which("unshare") and shutil.which("ip")), reason="needs unshare and ip")
@pytest.mark.parametrize("line", some([*LINES], every=2))
def test_a_whole_mission_over_a_line_that_loses_delays_and_reorders_packets(
    tmp_path: Path, line: str
) -> None:
    loss, delay_s, bits_per_s = LINES[line]
    command = [
        "unshare",
        "--user",
        "--map-root-user",
        "--net",
        sys.executable,
        "-m",
        "tests.faults.rough_line",
    ]
    command += [str(tmp_path), str(loss), str(delay_s), str(bits_per_s), "200" if FULL else "60"]
    root = Path(__file__).parents[2]
    environment = os.environ | {"PYTHONPATH": str(root)}
    ended = subprocess.run(
        command, capture_output=True, text=True, timeout=240, env=environment, cwd=root, check=False
    )
    if "cannot make a line" in ended.stderr or "unshare:" in ended.stderr:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr
    outcome = json.loads(ended.stdout)
    print(line, outcome)
    assert outcome["same"]
    assert outcome["told"] == RUN
    assert outcome["numbers"] == list(range(1, len(RUN) + 1))
    assert (outcome["state"], outcome["journal"]) == ("FINISHED", len(RUN))
    assert outcome["overtaken"] > 0
    assert (outcome["lost"] > 0) == (loss > 0)

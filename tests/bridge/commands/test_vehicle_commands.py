"""The whole way as a person goes it; a vehicle and who watches it in processes of their own, one killed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.document import Scan
from stopgo.mission.files.mission_json import write
from stopgo.mission.run.events import Finished, Scanned
from stopgo.recordings.embedded.reading import read_recording
from tests.bridge.mavlink.auto.site import real_tour
from tests.called import stopgo
from tests.ports import free_port

STOPGO = (sys.executable, "-m", "stopgo")
KEYS = (
    "robot boot_id state run_id mission_id revision stop done skipped outside"
    " battery battery_ok position_ok fence_ok age_s"
)


class Vehicle:
    """A simulated vehicle's process, and the folder of the station that talks to it."""

    def __init__(self, folder: Path) -> None:
        port = free_port()
        self.url = str(Url("udpout", "127.0.0.1", port))
        self.state = folder / "station"
        self.mission = folder / "mission.json"
        write(real_tour(), self.mission)
        self.process = subprocess.Popen(
            [*STOPGO, "simulate", "vehicle", "--mavlink", f"udpin:127.0.0.1:{port}",
             "--autopilot", "ardupilot",
             "--origin", "51.5,7.5,100", "--at", "0,0,0", "--speed-up", "10"],
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stderr is not None
        assert "ready" in self.process.stderr.readline()

    def words(self, verb: str, *options: str) -> list[str]:
        return [verb, *options, "--mavlink", self.url, "--vehicle", "1", "--state", str(self.state)]

    def command(self, verb: str, *options: str) -> list[str]:
        return [*STOPGO, *self.words(verb, *options)]

    def run(self, verb: str, *options: str) -> subprocess.CompletedProcess[str]:
        return stopgo(*self.words(verb, *options))


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    made = Vehicle(tmp_path)
    try:
        yield made
    finally:
        made.process.terminate()
        made.process.wait(60)


HOURS = Scan(profile="default", duration_s=6e4, timeout_s=7e4)
"""A scan during which a run is under way however slow the machine is."""


def test_a_mission_is_pushed_started_and_watched_to_its_end(vehicle: Vehicle, tmp_path: Path) -> None:
    first, second, third = real_tour().stops
    stops = (first, msgspec.structs.replace(second, scan=HOURS), third)
    write(msgspec.structs.replace(real_tour(), stops=stops), vehicle.mission)
    pushed = vehicle.run("push", str(vehicle.mission))
    assert pushed.returncode == 0, pushed.stderr
    refused = vehicle.run("start", "--json")
    assert refused.returncode == 1 and "--arm" in refused.stderr and refused.stderr.count("\n") == 1
    told = json.loads(refused.stdout)
    assert (told["outcome"], told["reason"]) == ("refused", "not_armed") and "--arm" in told["message"]

    # It watches before the run begins: a vehicle that nobody watches may have left its first stop.
    killed = subprocess.Popen(vehicle.command("watch"), stdout=subprocess.PIPE, text=True)
    assert killed.stdout is not None
    assert "waiting" in killed.stdout.readline()
    begun = vehicle.run("start", "--arm", "--json")
    assert begun.returncode == 0 and json.loads(begun.stdout)["state"] == "RUNNING"
    assert any("Scanned" in line for line in killed.stdout)
    killed.send_signal(signal.SIGKILL)
    killed.wait()

    told = vehicle.run("status", "--json")
    assert " ".join(json.loads(told.stdout)) == KEYS
    command = vehicle.command("watch", "--rrd", str(tmp_path / "field.rrd"), "--json")
    watching = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert watching.stdout is not None
    events = (json.loads(line) for line in watching.stdout)
    assert any((event["event"], event.get("stop")) == ("Arrived", "S2") for event in events)
    assert vehicle.run("skip").returncode == 0
    out, said = watching.communicate(timeout=120)
    assert watching.returncode == 1, said  # a stop was left out
    *events, told = map(json.loads, out.splitlines())
    assert events[-1]["event"] == "Finished"
    assert (told["done"], told["skipped"]) == (["S1", "S3"], ["S2"])
    (log,) = read_recording(tmp_path / "field.rrd").logs
    through = [event.stop for event in log.events if isinstance(event, Scanned)]
    assert sorted(through) == ["S1", "S3"]
    assert isinstance(log.events[-1], Finished)


def test_ctrl_c_in_watch_leaves_the_vehicle_alone(vehicle: Vehicle) -> None:
    write(real_tour(scan=HOURS), vehicle.mission)
    assert vehicle.run("push", str(vehicle.mission)).returncode == 0
    assert vehicle.run("start", "--arm").returncode == 0
    watching = subprocess.Popen(vehicle.command("watch"), stdout=subprocess.PIPE, text=True)
    assert watching.stdout is not None
    assert any("Arrived" in line for line in watching.stdout)
    watching.send_signal(signal.SIGINT)
    assert watching.wait(120) == 130
    assert json.loads(vehicle.run("status", "--json").stdout)["state"] == "RUNNING"
    aborted = vehicle.run("abort", "--disarm")
    assert aborted.returncode == 0, aborted.stderr
    assert vehicle.run("watch").returncode == 1


def test_options_of_the_other_link_are_refused(tmp_path: Path) -> None:
    link = ("--mavlink", f"udpout:127.0.0.1:{free_port()}", "--vehicle", "1", "--state", str(tmp_path))
    for verb, *options in (("start", "--robot", "r1"), ("watch", "--site", "hall"), ("pause", "--keys", "k")):
        told = stopgo(verb, *options, *link)
        assert told.returncode == 2 and "has no meaning with --mavlink" in told.stderr


def test_an_unsigned_link_out_of_this_machine_is_refused(tmp_path: Path) -> None:
    told = stopgo("start", "--mavlink", "udpout:192.0.2.1:14550", "--state", str(tmp_path))
    assert told.returncode == 2 and "--signing-key" in told.stderr

"""Station, robot's end and vehicle in processes of their own: run, recorded, killed and gone on with."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.commands.spawn import end_robot, robot_process, start, start_robot
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.station.station import connect
from stopgo.mission.document import Mission, Scan, with_digest
from stopgo.mission.run.events import Scanned
from tests.bridge.mavlink.driving.world import Operator, is_state, site_mission, until
from tests.called import stopgo
from tests.faults.sizes import some
from tests.ports import free_port

QUICK = {
    "ardupilot": ("--param", "WP_SPEED=1.5", "--param", "GUID_TIMEOUT=0.3"),
    "px4": ("--param", "RO_SPEED_LIM=1.5", "--param", "RO_DECEL_LIM=1"),
}


def brisk(**details: Any) -> Mission:
    """Two stops that are driven to and scanned in a few seconds: processes wait in real time."""
    made = site_mission(scan=Scan(profile="default", duration_s=1.0, timeout_s=20.0), **details)
    robot = msgspec.structs.replace(made.robot, speed=1.2, acceleration=1.5)
    stops = tuple(
        msgspec.structs.replace(
            stop, x=stop.x / 2, y=stop.y / 2, approach=tuple((x / 2, y / 2) for x, y in stop.approach)
        )
        for stop in made.stops
    )
    back = made.return_ and tuple((x / 2, y / 2) for x, y in made.return_)
    return with_digest(msgspec.structs.replace(made, robot=robot, stops=stops, return_=back))


@contextmanager
def vehicle(tmp_path: Path, profile: str) -> Iterator[tuple[Url, Operator]]:
    """A vehicle in a process of its own, on hold at the mission's start."""
    port = free_port()
    process = start(
        "simulate", "vehicle", "--mavlink", f"udpin:127.0.0.1:{port}", "--autopilot", profile,
        "--at", "0,0,0",
        *QUICK[profile],
        "--origin", "47.4,8.5,400,30", "--state", str(tmp_path / "vehicle"),
        called="the vehicle",
    )  # fmt: skip
    url = Url("udpout", "127.0.0.1", port)
    try:
        with reached(url, vehicle=1) as peer:
            operator = Operator(peer, profile)
            operator.hold()
            yield url, operator
    finally:
        end_robot(process)


def driving(url: Url) -> tuple[str, ...]:
    return ("--controller", f"mavlink:{url}", "--vehicle", "1", "--arm")


def scans_begun(operator: Operator) -> int:
    """Number of scans that the vehicle has begun, whoever knows of them."""
    last = operator.peer.ask(dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED)
    assert last is not None
    return int(last.image_index) + 1


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_mission_over_zenoh_is_driven_by_an_autopilot_and_recorded(tmp_path: Path, profile: str) -> None:
    document, field = tmp_path / "mission.json", tmp_path / "field.rrd"
    document.write_bytes(msgspec.json.encode(brisk(closed=profile == "ardupilot")))
    with (
        vehicle(tmp_path, profile) as (url, operator),
        robot_process("r1", tmp_path / "r1", extra=driving(url)) as endpoint,
    ):
        reach = ("--robot", "r1", "--connect", endpoint)
        assert stopgo("push", str(document), *reach).returncode == 0
        command = [sys.executable, "-m", "stopgo", "watch", *reach, "--rrd", str(field), "--json"]
        watch = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        started = stopgo("start", *reach)
        assert started.returncode == 0, started.stderr
        out, said = watch.communicate(timeout=120)
        assert watch.returncode == 0, said
        assert json.loads(out.splitlines()[-1])["done"] == ["s1", "s2"]
        assert scans_begun(operator) == 2
    review = json.loads(stopgo("review", str(field), "--json").stdout)
    assert review["mission_id"] == site_mission().id
    (run,) = review["runs"]
    assert (run["scanned"], run["ended"]) == (2, "Finished")
    assert max(stop["deviation_m"] for stop in run["stops"]) < 0.05


@pytest.mark.parametrize(("stop", "doing"), some([("s1", "SCANNING"), ("s2", "NAVIGATING")], every=2))
def test_a_killed_gateway_comes_back_paused_and_scans_no_stop_twice(
    tmp_path: Path, stop: str, doing: str
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with vehicle(tmp_path, "ardupilot") as (url, operator):
        gateway = start_robot("r1", tmp_path / "r1", listen=endpoint, extra=driving(url))
        try:
            with connect(endpoint, robot="r1") as station:
                station.push(brisk())
                station.command("start")
                until(
                    station.reports(),
                    lambda report: (
                        (getattr(report, "stop", ""), getattr(report, "stop_state", "")) == (stop, doing)
                    ),
                )
                gateway.kill()
                gateway.wait()
                gateway = start_robot("r1", tmp_path / "r1", listen=endpoint, extra=driving(url))
                station.reach(endpoint)
                assert station.status().state == "PAUSED"
                assert operator.mode() == "HOLD"
                station.command("resume")
                until(station.reports(), is_state("FINISHED"))
                scanned = [event.stop for event in station.log() if isinstance(event, Scanned)]
            assert scanned == ["s1", "s2"]
            assert scans_begun(operator) <= 2 + (doing == "SCANNING")
        finally:
            end_robot(gateway)

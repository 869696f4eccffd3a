"""`push`, `fetch-mission` and `clear` at the simulated vehicle: what they print and end with."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.auto.logbook import logbook, remember
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import read_vehicle_faults
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.command_line import main
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.files.imports import qgc_plan, qgc_waypoints
from stopgo.mission.files.imports.track import ImportOptions
from stopgo.mission.files.mission_json import write
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Aborted
from stopgo.mission.run.states import started
from tests.bridge.mavlink.lists import held, stops
from tests.bridge.mavlink.scripted import Scripted
from tests.mission.mavlink.following.worlds import tour
from tests.ports import free_port

pytestmark = pytest.mark.usefixtures("own_time")

KEY = bytes(range(32))
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def mission() -> Mission:
    return tour()


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str], mission: Mission) -> Run:
    """Runs a command; gives its exit code, what it printed, and what it said."""
    write(mission, tmp_path / "mission.json")

    def command(*words: str) -> tuple[int, str, str]:
        remembers = words[0] in ("push", "clear") and "--mavlink" in words
        state = ["--state", str(tmp_path / "state")] if remembers else []
        code = main([word.replace("MISSION", str(tmp_path / "mission.json")) for word in (*words, *state)])
        return code, *capsys.readouterr()

    return command


@contextmanager
def vehicle(
    profile: str = "ardupilot",
    *faults: str,
    origin: SiteOrigin | None = None,
    key: bytes | None = None,
) -> Iterator[Url]:
    port = free_port()
    made = read_vehicle_faults(faults)
    setup = VehicleSetup(PROFILES[profile], origin=origin, faults=made)
    with vehicle_on(Url("udpin", "127.0.0.1", port), setup, signing_key=key):
        yield Url("udpout", "127.0.0.1", port)


def at_site(mission: Mission, *faults: str, **details: Any) -> AbstractContextManager[Url]:
    return vehicle(*(faults or ("ardupilot",)), origin=mission.georeference, **details)


@pytest.mark.parametrize("profile", list(PROFILES))
def test_a_mission_is_pushed_read_and_cleared(profile: str, run: Run, tmp_path: Path) -> None:
    with vehicle(profile) as url:
        to = ("--mavlink", str(url), "--vehicle", "1")
        code, _, said = run("push", "MISSION", *to)
        assert (code, "has no origin" in said and "--set-origin" in said) == (1, True)
        code, printed, _ = run("push", "MISSION", *to, "--set-origin")
        assert code == 0
        assert "holds room (0123456789ab revision 1): 14 items for 3 stops, read back and compared" in printed
        code, printed, _ = run("push", "MISSION", *to, "--json")
        report = json.loads(printed)
        assert (code, report["already"], report["items"], report["stops"]) == (0, True, 14, 3)
        assert report["origin"] == {"lat": 51.5, "lon": 7.5, "alt": 100.0}
        code, printed, _ = run("fetch-mission", *to, "-o", str(tmp_path / "held.json"))
        assert code == 0
        assert len(json.loads((tmp_path / "held.json").read_text())["items"]) == 14
        code, printed, _ = run("clear", *to, "--json")
        assert (code, json.loads(printed)["had"]) == (0, 14)
        with logbook(url, 1, tmp_path / "state") as book:
            assert (book.run.state, book.listed) == ("IDLE", None)
        code, printed, _ = run("fetch-mission", *to)
        assert (code, "holds 0 items" in printed) == (0, True)


@pytest.mark.parametrize("suffix", ["plan", "waypoints"])
def test_what_is_fetched_opens_as_a_file(suffix: str, run: Run, mission: Mission, tmp_path: Path) -> None:
    path = tmp_path / f"held.{suffix}"
    with at_site(mission) as url:
        assert run("push", "MISSION", "--mavlink", str(url))[0] == 0
        assert run("fetch-mission", "--mavlink", str(url), "-o", str(path))[0] == 0
    given = ImportOptions(mission.georeference, "ardupilot")
    read = {"plan": qgc_plan, "waypoints": qgc_waypoints}[suffix].read(path.read_bytes(), suffix, given)
    assert [visit.xy for visit in read.visits] == [
        pytest.approx((stop.x, stop.y), abs=0.008) for stop in mission.stops
    ]


@pytest.mark.parametrize(
    ("profile", "radius"), [("ardupilot", "WP_RADIUS 0.02 m"), ("px4", "NAV_ACC_RAD 0.5 m")]
)
def test_a_push_reports_first_what_the_vehicle_makes_of_the_tolerances(
    run: Run, profile: str, radius: str
) -> None:
    with vehicle(profile) as url:
        code, out, said = run("push", "MISSION", "--mavlink", str(url), "--set-origin", "--json")
    assert code == 0
    assert f"in AUTO ({radius}, 1 m/s), and" in said
    assert "or drive it by stopgo robot --controller mavlink:URL" in json.loads(out)["notes"][0]


def test_what_was_pushed_is_in_the_logbook(run: Run, mission: Mission, tmp_path: Path) -> None:
    with at_site(mission) as url:
        assert run("push", "MISSION", "--mavlink", str(url))[0] == 0
        with logbook(url, 1, tmp_path / "state") as book:
            assert book.listed is not None and book.listed.mission == mission


def test_another_origin_is_refused(run: Run) -> None:
    with vehicle(origin=SiteOrigin(lat=51.5001, lon=7.5, alt=100.0, heading_deg=0.0)) as url:
        code, _, said = run("push", "MISSION", "--mavlink", str(url), "--set-origin")
        assert (code, "11.13 m from the mission's" in said, "nothing was sent" in said) == (1, True, True)
        assert run("push", "MISSION", "--mavlink", str(url), "--skip-origin-check")[0] == 0


def test_a_vehicle_that_follows_its_mission_is_let_be_in_each_commands_words(run: Run) -> None:
    with Scripted(held(stops(3))) as vehicle:
        vehicle.base_mode = dialect.MAV_MODE_FLAG_SAFETY_ARMED | dialect.MAV_MODE_FLAG_AUTO_ENABLED
        to = ("--mavlink", str(vehicle.url), "--vehicle", "1", "--json")
        for words, harm in (
            (("push", "MISSION"), "would begin its current item again"),
            (("clear",), "would be left without one"),
        ):
            code, printed, said = run(*words, *to)
            told = json.loads(printed)
            assert (code, told["outcome"], told["reason"]) == (1, "refused", None)
            assert harm in told["message"] and said == f"stopgo: {told['message']}\n"
        assert vehicle.heard["MISSION_COUNT"] == vehicle.heard["MISSION_CLEAR_ALL"] == 0


def test_a_run_that_is_not_over_keeps_its_mission(run: Run, mission: Mission, tmp_path: Path) -> None:
    with Scripted(held(stops(3))) as vehicle:
        with logbook(vehicle.url, 1, tmp_path / "state") as book:
            remember(book, mission, translate(mission, "generic"))
            book.move(lambda run: (started(run, run_id="r7", now_ns=0, by="me"),))
        to = ("--mavlink", str(vehicle.url), "--vehicle", "1")
        for words in (("push", "MISSION"), ("clear",)):
            code, printed, said = run(*words, *to, "--json")
            assert (code, json.loads(printed)["reason"], "run r7" in said) == (1, "running", True)
        assert vehicle.heard["MISSION_REQUEST_LIST"] == vehicle.heard["MISSION_COUNT"] == 0
        assert run("clear", *to, "--while-running")[0] == 0
        with logbook(vehicle.url, 1, tmp_path / "state") as book:
            assert book.run.state == "IDLE" and isinstance(book.journal.events()[-1], Aborted)


def test_an_item_that_is_refused_once_is_tried_again(run: Run, mission: Mission) -> None:
    with at_site(mission, "ardupilot", "nack@4=6") as url:
        assert run("push", "MISSION", "--mavlink", str(url))[0] == 0


def test_a_lost_last_ack_is_no_failure(run: Run, mission: Mission) -> None:
    with at_site(mission, "px4", "lostack@1") as url:
        assert run("push", "MISSION", "--mavlink", str(url))[0] == 0


def test_a_restart_during_the_upload_is_reported(run: Run, mission: Mission) -> None:
    with at_site(mission, "ardupilot", "reboot-upload@5") as url:
        with reached(url, vehicle=1) as peer, peer.waiting("ATTITUDE") as waiting:
            while waiting.get(10.0).time_boot_ms < 3000:  # longer than it is away
                pass
        code, _, said = run("push", "MISSION", "--mavlink", str(url), "--timeout", "2")
        assert (code, "was restarted" in said) == (1, True), said


def test_a_vehicle_that_falls_silent_leaves_it_unknown(run: Run, mission: Mission) -> None:
    with at_site(mission, "ardupilot", "silent@5=0") as url:
        code, _, said = run("push", "MISSION", "--mavlink", str(url), "--timeout", "1")
    assert (code, "no data after" in said, "do not start it" in said) == (3, True, True)


def test_a_key_is_needed_where_the_vehicle_has_one(run: Run, mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "key").write_text(KEY.hex())
    (tmp_path / "other").write_text("another one")
    with at_site(mission, key=KEY) as url:
        to = ("push", "MISSION", "--mavlink", str(url), "--timeout", "1.5")
        code, _, said = run(*to, "--signing-key", str(tmp_path / "other"))
        assert (code, "wrong or no signature" in said) == (2, True), said
        code, _, said = run(*to)
        assert (code, "--signing-key" in said) == (2, True), said
        code, _, said = run(*to, "--signing-key", str(tmp_path / "key"))
        assert code == 0, said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("push", "MISSION"), "--robot NAME, or --mavlink URL"),
        (("push", "MISSION", "--mavlink", "udp:1"), "not a MAVLink URL"),
        (("push", "MISSION", "--mavlink", "udpout:10.0.0.7:14550"), "leaves this machine unsigned"),
        (
            ("push", "MISSION", "--robot", "r1", "--mavlink", "udpout:127.0.0.1:9"),
            "--robot has no meaning with",
        ),
        (("push", "MISSION", "--robot", "r1", "--set-origin"), "--set-origin has no meaning with --robot"),
        (
            ("push", "MISSION", "--mavlink", "udpout:127.0.0.1:9", "--autopilot", "ardu"),
            "--autopilot ardu: one of",
        ),
        (("push", "MISSION", "--mavlink", "udpout:127.0.0.1:9", "--trigger", "horn"), "--trigger horn"),
        (("push", "MISSION", "--mavlink", "udpout:127.0.0.1:9", "--timeout", "0.3"), "nothing was sent"),
        (
            ("fetch-mission", "--mavlink", "udpout:127.0.0.1:9", "-o", "held.dxf"),
            "*.json, *.waypoints, *.plan",
        ),
        (("clear", "--mavlink", "udpout:127.0.0.1:9", "--timeout", "0.3"), "nothing was sent"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(words: tuple[str, ...], said: str, run: Run) -> None:
    if "--trigger" in words:
        words = (*words, "--autopilot", "ardupilot")
    code, printed, errors = run(*words)
    assert (code, printed) == (2, "")
    assert said in errors and errors.count("\n") == 1


class Stalls(Scripted):
    """Asks again and again for item 5."""

    def on_mission_item_int(self, message: Any, to: Any) -> None:
        if message.seq < 5:
            super().on_mission_item_int(message, to)


@pytest.mark.real_time
def test_ctrl_c_cancels_and_reports_what_is_on_the_vehicle(tmp_path: Path, mission: Mission) -> None:
    write(with_digest(mission), tmp_path / "mission.json")
    with Stalls(held(stops(3))) as stalling:
        command = [
            sys.executable,
            "-m",
            "stopgo",
            "push",
            str(tmp_path / "mission.json"),
            "--skip-origin-check",
        ]
        command += ["--mavlink", str(stalling.url), "--vehicle", "1", "--state", str(tmp_path / "state")]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        with stalling.wire.waiting("MISSION_ITEM_INT") as waiting:
            assert waiting.get(20.0) is not None
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120.0)
    assert process.returncode == 130
    assert "the upload was cancelled; it still holds the mission it had before (6 items)" in said
    assert said.endswith("stopgo: stopped by Ctrl-C\n")

"""Vehicles that drive their own lists on the page: live state, orders, STOP, and what is not possible."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.station.roster import RosterVehicle, read_roster, read_roster_vehicles
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import UNKNOWN_CHARGE, StateReport
from stopgo.site.event_feed import EventFeed
from stopgo.site.robot_orders import OrderRequest, PushRequest, StopRequest
from stopgo.site.site_folder import SiteFiles
from stopgo.site.web_server import SiteFleet, SiteOptions
from tests.bridge.mavlink.auto.site import Site
from tests.waiting import LAST_RESORT_S, wait_until

SPEED_UP = 20.0
REPORT = StateReport(
    robot="rover", boot_id="b", seq=1, robot_ns=1, state="IDLE", run_id=None, mission_id=None, revision=None,
    stop=None, stop_state=None, done=(), skipped=(), battery=1.0, last_event=0,
)  # fmt: skip


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Site:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return Site(tmp_path, speed_up=SPEED_UP)


@pytest.fixture
def fleet(site: Site, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[SiteFleet]:
    """The site's vehicle on a page that may arm it, and waits 1 s for an answer, or as long as is asked."""
    timeout_s, stopped = getattr(request, "param", 1.0), threading.Event()
    options = SiteOptions(tmp_path, "", commander="anna", timeout_s=timeout_s)
    made = SiteFleet(Switchboard().link(), options, None, EventFeed(), SiteFiles.at(tmp_path), stopped)
    made.add_vehicle("rover", RosterVehicle(mavlink=str(site.url), vehicle=1, arm=True, set_origin=True))
    yield made
    stopped.set()
    for thread in made.threads:
        thread.join()


def events(feed: EventFeed) -> set[str]:
    return {told.value["event"] for key, told in feed.since(-1) if key[0] == "event"}


def shown(fleet: SiteFleet) -> dict[str, Any]:
    return fleet.feed.value("robot", "rover") or {}


@pytest.mark.parametrize("fleet", [LAST_RESORT_S], indirect=True)
def test_a_vehicle_is_pushed_to_started_stopped_and_resumed(site: Site, fleet: SiteFleet) -> None:
    orders, feed = fleet.orders, fleet.feed
    with site.up():
        wait_until(lambda: shown(fleet).get("state") == "IDLE")
        pushed = orders.push("rover", PushRequest(id="1", file="m"), site.mission).result()
        assert pushed.outcome == "ok", pushed.message
        wait_until(lambda: feed.value("mission", "rover"))
        wait_until(lambda: feed.value("pose", "rover"))  # it has an origin, and so a position, since the push
        started = orders.order("rover", OrderRequest(id="2", verb="start")).result()
        assert started.state == "RUNNING", started.message
        wait_until(lambda: (feed.value("pose", "rover") or {"speed": 0})["speed"] > 0.1)
        (stopped,) = [one.result() for one in orders.stop(StopRequest(id="3"))]
        record = wait_until(lambda: (told := feed.value("stop", "rover")) and told["standing_at"] and told)
        assert record["sent_at"] <= record["heard_at"] <= record["standing_at"]
        assert (stopped.outcome, shown(fleet)["state"]) == ("ok", "PAUSED")
        assert feed.value("pose", "rover")["speed"] < 0.03  # type: ignore[index]
        assert shown(fleet)["vehicle"] == {"url": str(site.url), "cannot": ["home"]}
        home = orders.order("rover", OrderRequest(id="4", verb="home")).result()
        assert (home.outcome, home.reason) == ("refused", "unsupported")
        assert orders.order("rover", OrderRequest(id="5", verb="resume")).result().state == "RUNNING"
        wait_until(lambda: {"Started", "Paused", "Resumed"} <= events(feed))


def test_a_vehicle_that_is_away_is_shown_with_the_reason(fleet: SiteFleet, site: Site) -> None:
    wait_until(lambda: any("no vehicle" in one for one in shown(fleet).get("trouble", ())))
    assert "state" not in shown(fleet)


@pytest.mark.parametrize(("charge", "shown_charge"), [(UNKNOWN_CHARGE, None), (0.99, 0.99)])
def test_a_charge_that_nobody_reports_is_unknown(
    charge: float, shown_charge: float | None, fleet: SiteFleet, site: Site
) -> None:
    fleet.orders.robot("rover")._newest(replace(REPORT, battery=charge))
    assert shown(fleet)["battery"] == shown_charge


def test_states_go_on_while_the_plan_of_a_mission_is_read(
    fleet: SiteFleet, site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, add, may_read = fleet.orders.robot("rover"), fleet.missions.add, threading.Event()
    monkeypatch.setattr(fleet.missions, "add", lambda mission: may_read.wait(LAST_RESORT_S) and add(mission))
    monkeypatch.setattr(robot.station, "mission", lambda mission_id, revision: site.mission)
    mission = site.mission
    for seq in (1, 2):
        robot._newest(replace(REPORT, seq=seq, mission_id=mission.id, revision=mission.revision))
    assert (shown(fleet)["seq"], fleet.feed.value("mission", "rover")) == (2, None)
    may_read.set()
    wait_until(lambda: fleet.feed.value("mission", "rover"))
    wait_until(lambda: fleet.feed.value("coverage", "rover"))


def test_a_mission_that_was_not_started_has_no_stops_of_the_run_before(
    fleet: SiteFleet, site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, mission = fleet.orders.robot("rover"), site.mission
    other = replace(mission, id="another")
    held = {one.id: one for one in (mission, other)}
    monkeypatch.setattr(robot.station, "mission", lambda mission_id, revision: held[mission_id])
    stop = mission.stops[0].id
    done = replace(REPORT, state="FINISHED", run_id="run", mission_id=mission.id, revision=mission.revision)
    ready = replace(done, state="READY", seq=2, mission_id=other.id)
    shown_done: list[tuple[str, ...]] = []
    for report in (done, ready, replace(done, state="RUNNING", seq=3, run_id="next", mission_id=other.id)):
        robot._newest(report)
        robot._run_id, robot._stops = "run", {stop: "done"}
        assert robot._plan_reader is not None
        robot._plan_reader.join()
        robot._tell_coverage()
        shown_done.append((fleet.feed.value("coverage", "rover") or {})["done"])
    assert shown_done == [(stop,), (), ()]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            '[vehicles.r1]\nmavlink = "udpout:h:1"\nspeed = 1',
            "vehicle r1: Object contains unknown field `speed`",
        ),
        ("[vehicles.r1]\nvehicle = 1", "vehicle r1: Object missing required field `mavlink`"),
        ('[vehicles.r1]\nmavlink = "x"\nvehicle = 900', "vehicle r1: Expected `int` <= 255"),
        ('robots = ["r1"]\n[vehicles.r1]\nmavlink = "x"', "r1 is a robot and a vehicle"),
        ('vehicles = "x"', "vehicles must be tables"),
        ('[vehicles."a b"]\nmavlink = "x"', "use letters, digits"),
        ("", "must be one list"),
    ],
)
def test_a_wrong_roster_is_refused_with_one_line(tmp_path: Path, text: str, line: str) -> None:
    path = tmp_path / "robots.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_roster_vehicles(path)
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_a_roster_names_robots_and_vehicles(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    path.write_text('robots = ["r1"]\n[vehicles.rover]\nmavlink = "udpout:h:1"\nsigning_key = "rover.key"\n')
    assert read_roster(path) == ("r1",)
    assert read_roster_vehicles(path)["rover"].signing_key == str(tmp_path / "rover.key")

"""A site's keys: who is let in, who may order, and what is refused before anything is opened."""

from __future__ import annotations

import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link import keys as site_keys
from stopgo.bridge.link.authority import init_site, issue, listed
from stopgo.bridge.link.keys import Certificates, Untrusted, now_utc, read_keys
from stopgo.bridge.link.link import Link, Request
from stopgo.bridge.link.protocol import KeyExpressions, Reply, encode
from stopgo.bridge.link.zenoh_link import Guard, check_endpoint, connecting
from stopgo.bridge.robot.agent import check_ordering
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import InputError, NegativeResult, RobotUnreachable
from stopgo.mission.run.events import PoseReport, Scanned
from tests.bridge.station.test_fleet import router
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.ports import free_port

NOW = now_utc()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site with a robot, two stations, a viewer, and a stranger's keys from another authority."""
    folder = tmp_path_factory.mktemp("keys")
    init_site(folder / "site", now=NOW)
    init_site(folder / "other", now=NOW)
    for role, name in (("robot", "r1"), ("station", "alice"), ("station", "bob"), ("viewer", "vera")):
        issue(folder / "site", role, name, now=NOW)  # type: ignore[arg-type]
    issue(folder / "other", "station", "stranger", now=NOW)
    return folder


def certificates(site: Path, *, now: datetime = NOW) -> Certificates:
    """Whom a robot of the site believes."""
    return Certificates(read_keys(site / "site" / "r1", now=NOW), lambda: now)


def test_a_certificate_reports_who_holds_it(site: Path) -> None:
    holder, _ = certificates(site).holder(read_keys(site / "site" / "alice", now=NOW).der)
    assert (holder.role, holder.name) == ("station", "alice")


def test_a_certificate_of_another_authority_or_of_none_is_not_trusted(site: Path) -> None:
    stranger = read_keys(site / "other" / "stranger", now=NOW).der
    for der, why in ((stranger, "another authority"), (b"", "can be read"), (b"\x30\x00", "can be read")):
        with pytest.raises(Untrusted, match=why):
            certificates(site).holder(der)


def test_a_certificate_with_a_bit_flipped_names_nobody_else(site: Path) -> None:
    """And nothing else is raised: a robot that nobody can stop would come of it."""
    der = read_keys(site / "site" / "alice", now=NOW).der
    robot = certificates(site)
    good, believed = robot.holder(der)[0], []
    for at in range(len(der) * 8):
        flipped = bytearray(der)
        flipped[at // 8] ^= 1 << at % 8
        with warnings.catch_warnings(), suppress(Untrusted):
            warnings.simplefilter("ignore")
            believed.append(robot.holder(bytes(flipped))[0])
    # A few bits around what is signed mean nothing.
    assert all(holder == good for holder in believed)
    assert len(believed) < 10


def test_an_expired_certificate_is_not_trusted(site: Path) -> None:
    with pytest.raises(Untrusted, match="ends"):
        certificates(site, now=NOW + timedelta(days=91)).holder(
            read_keys(site / "site" / "alice", now=NOW).der
        )


def test_only_stations_command_and_only_under_their_own_name(site: Path) -> None:
    def request(who: str) -> Request:
        holder, _ = certificates(site).holder(read_keys(site / "site" / who, now=NOW).der)
        return Request("k", b"m", holder=holder)

    check_ordering(request("alice"), "alice")
    with pytest.raises(Untrusted, match="signed by bob, not by alice"):
        check_ordering(request("bob"), "alice")
    with pytest.raises(Untrusted, match="vera is a viewer"):
        check_ordering(request("vera"), "vera")


def test_keys_that_do_not_fit_are_named(site: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_keys(tmp_path, now=NOW)
    with pytest.raises(InputError, match=r"valid from .* issue new keys for alice"):
        read_keys(site / "site" / "alice", now=NOW + timedelta(days=91))
    files = site_keys.KeyFiles(tmp_path)
    for name in ("ca.pem", "cert.pem", "key.pem", "revoked.json"):
        (tmp_path / name).write_bytes((site / "site" / "alice" / name).read_bytes())
    files.key.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        read_keys(tmp_path, now=NOW)
    files.key.chmod(0o600)
    files.key.write_bytes((site / "site" / "bob" / "key.pem").read_bytes())
    with pytest.raises(InputError, match="is not the key of"):
        read_keys(tmp_path, now=NOW)
    files.authority.write_bytes((site / "other" / "authority" / "ca.pem").read_bytes())
    with pytest.raises(InputError, match="not issued by"):
        read_keys(tmp_path, now=NOW)


def test_the_private_key_is_for_its_owner_alone(site: Path) -> None:
    assert (site / "site" / "alice" / "key.pem").stat().st_mode & 0o777 == 0o600


def test_nothing_is_overwritten(site: Path) -> None:
    with pytest.raises(InputError, match="has an authority already"):
        init_site(site / "site", now=NOW)
    with pytest.raises(InputError, match="exists"):
        issue(site / "site", "viewer", "alice", now=NOW)
    assert [issued.holder.name for issued in listed(site / "site", now=NOW)] == ["alice", "bob", "r1", "vera"]


def test_an_endpoint_must_be_guarded_as_it_should(site: Path) -> None:
    keys = Guard(read_keys(site / "site" / "alice", now=NOW))
    check_endpoint("tls/10.0.0.1:7447", keys, option="--connect")
    with pytest.raises(InputError, match="tcp cannot carry keys"):
        check_endpoint("tcp/10.0.0.1:7447", keys, option="--connect")
    with pytest.raises(InputError, match="tls needs --keys"):
        check_endpoint("tls/10.0.0.1:7447", Guard(insecure=True), option="--connect")


def issue_until(folder: Path, role: site_keys.HolderRole, name: str, *, seconds: float) -> None:
    """Keys that were issued for a day, which ends in so many seconds."""
    issue(folder, role, name, now=now_utc() + timedelta(seconds=seconds, days=-1), days=1)


class Presence:
    """Times at which a robot appeared and disappeared on a link."""

    def __init__(self, link: Link, robot: str) -> None:
        self.changes: list[bool] = []
        self.came, self.went = threading.Event(), threading.Event()
        link.watch_presence(KeyExpressions(robot).alive, self.changed)

    def changed(self, key: str, alive: bool) -> None:
        self.changes.append(alive)
        (self.came if alive else self.went).set()


@contextmanager
def guarded_robot(site: Path, state: Path) -> Iterator[str]:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    extra = ("--keys", str(site / "site" / "r1"))
    robot = start_robot("r1", state, listen=endpoint, speed_up=100, extra=extra)
    try:
        yield endpoint
    finally:
        end_robot(robot)


def test_a_station_with_keys_runs_a_mission_and_a_viewer_watches(site: Path, tmp_path: Path) -> None:
    with guarded_robot(site, tmp_path) as endpoint:
        with connect(endpoint, robot="r1", keys=site / "site" / "alice") as station:
            station.push(corridor())
            station.command("start")
            assert station.commander == "alice"
        with connect(endpoint, robot="r1", keys=site / "site" / "vera") as viewer:
            reports = list(viewer.reports())
            assert [report.stop for report in reports if isinstance(report, Scanned)] == ["s1", "s2", "s3"]
            poses = [report for report in reports if isinstance(report, PoseReport)]
            assert poses[0].mission_time_s is not None
            assert poses[0].mission_time_s < 20, "the poses from before the viewer came are missing"
            assert viewer.mission(corridor().id, 1) == corridor()
            for order in (lambda: viewer.command("abort"), lambda: viewer.push(corridor(revision=2))):
                with pytest.raises(NegativeResult, match="vera is a viewer"):
                    order()
        status = stopgo("status", "--connect", endpoint, "--keys", str(site / "site" / "vera"), "--json")
        assert '"state": "FINISHED"' in status.stdout, status.stderr


@pytest.fixture(scope="module")
def robot_at_rest(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Endpoint of a robot that nobody starts."""
    with guarded_robot(site, tmp_path_factory.mktemp("robot")) as endpoint:
        yield endpoint


def test_strangers_and_plain_links_do_not_reach_the_robot(site: Path, robot_at_rest: str) -> None:
    stranger = connect(robot_at_rest, robot="r1", keys=site / "other" / "stranger", timeout_s=1.5)
    with pytest.raises(RobotUnreachable), stranger:
        pass
    plain = connect(robot_at_rest.replace("tls/", "tcp/"), robot="r1", timeout_s=1.5)
    with pytest.raises(RobotUnreachable), plain:
        pass
    with connect(robot_at_rest, robot="r1", keys=site / "site" / "alice") as station:
        assert station.status().state in ("IDLE", "READY")


LIVES = (8, 24, 72, 216)
"""How many seconds a certificate lasts; one that ends before the link is up is followed by a longer one."""
PATIENCE_S = 60.0


def test_a_link_is_closed_when_the_stations_certificate_ends(site: Path, tmp_path: Path) -> None:
    with guarded_robot(site, tmp_path) as endpoint:
        assert any(left_when_the_stations_ends(site, endpoint, lasts) for lasts in LIVES)


def left_when_the_stations_ends(site: Path, endpoint: str, lasts: int) -> bool:
    """True if there was a link before the certificate ended; then it was closed at that end."""
    name = f"brief{lasts}"
    issue_until(site / "site", "station", name, seconds=lasts)
    brief = read_keys(site / "site" / name, now=now_utc())
    with connecting(endpoint, Guard(brief)) as link:
        seen = Presence(link, "r1")
        if not seen.came.wait(lasts):
            return False
        assert seen.went.wait(lasts + PATIENCE_S), "the link outlives the certificate"
        # Another station is let in meanwhile, and what it does takes longer than a reconnect.
        with connect(endpoint, robot="r1", keys=site / "site" / "alice") as station:
            station.push(corridor())
            station.command("start")
            assert len([1 for report in station.reports() if isinstance(report, Scanned)]) == 3
        assert link.ask(KeyExpressions("r1").info, timeout_s=1) is None
    with pytest.raises(InputError, match=f"issue new keys for {name}"):
        read_keys(site / "site" / name, now=now_utc())
    return True


def test_a_link_is_closed_when_the_robots_certificate_ends(site: Path, tmp_path: Path) -> None:
    assert any(left_when_the_robots_ends(site, tmp_path, lasts) for lasts in LIVES)


def left_when_the_robots_ends(site: Path, folder: Path, lasts: int) -> bool:
    """True if there was a link before the certificate ended; then it was closed at that end."""
    name = f"robot{lasts}"
    issue_until(site / "site", "robot", name, seconds=lasts)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    robot = start_robot(name, folder, listen=endpoint, extra=("--keys", str(site / "site" / name)))
    try:
        with connecting(endpoint, Guard(read_keys(site / "site" / "alice", now=NOW))) as link:
            seen = Presence(link, name)
            if not seen.came.wait(lasts):
                return False
            assert seen.went.wait(lasts + PATIENCE_S), "the link outlives the certificate"
            # In its very last second a certificate is still taken for a new link.
            over = read_keys(site / "site" / name, now=NOW).holder.not_after + timedelta(seconds=1)
            time.sleep(max(0.0, (over - now_utc()).total_seconds()))
            late = connect(endpoint, robot=name, keys=site / "site" / "alice", timeout_s=3)
            with pytest.raises(RobotUnreachable), late:
                pass
            assert link.ask(KeyExpressions(name).info, timeout_s=1) is None
        # A link that was opened anew in the last second is one that the robot has left.
        assert seen.changes == [True, False] * (len(seen.changes) // 2)
        assert robot.poll() is None
        return True
    finally:
        end_robot(robot)


def test_a_viewer_that_commands_is_refused_and_a_forged_name_is_not_believed(
    site: Path, robot_at_rest: str
) -> None:
    keys, endpoint = KeyExpressions("r1"), robot_at_rest
    with connect(endpoint, robot="r1", keys=site / "site" / "alice") as station:
        station.push(corridor())
        order = station.order("start")
    key = keys.command("start")
    vera = read_keys(site / "site" / "vera", now=NOW)
    with connecting(endpoint, Guard(vera)) as link:
        Station(link, keys, commander="vera").reach(endpoint)
        refused = link.ask(key, encode(order), timeout_s=2)
    with connect(endpoint, robot="r1", keys=site / "site" / "bob") as other:
        forged = other.link.ask(key, encode(order), timeout_s=1)
        assert other.status().state == "READY"
    assert refused is not None
    assert "vera is a viewer" in msgspec.json.decode(refused, type=Reply).messages[0]
    assert forged is not None
    assert "signed by bob, not by alice" in msgspec.json.decode(forged, type=Reply).messages[0]


def test_behind_a_router_signatures_report_who_commands(site: Path, tmp_path: Path) -> None:
    """The router's link is let in whole; a viewer's order comes through it, and is not trusted."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    issue(site / "site", "router", "router", now=NOW)
    extra = ("--connect", endpoint, "--keys", str(site / "site" / "r1"))
    with router(endpoint, str(site / "site" / "router")):
        robot = start_robot("r1", tmp_path, listen=None, speed_up=100, extra=extra)
        try:
            with connect(endpoint, robot="r1", keys=site / "site" / "alice") as station:
                station.push(corridor())
                order = station.order("start", commander="vera")
                vera = read_keys(site / "site" / "vera", now=NOW)
                key = KeyExpressions("r1").command("start")
                with connecting(endpoint, Guard(vera)) as link:
                    Station(link, KeyExpressions("r1"), commander="vera").reach(endpoint)
                    reply = link.ask(key, encode(order), timeout_s=2)
                assert reply is not None
                assert "vera is a viewer" in msgspec.json.decode(reply, type=Reply).messages[0]
                assert station.command("start").outcome == "ok"
                assert len([1 for report in station.reports() if isinstance(report, Scanned)]) == 3
        finally:
            end_robot(robot)

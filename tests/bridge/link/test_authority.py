"""Keys are listed, renewed and called back; certificates name who, apart from the role; files are guarded."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link import authority
from stopgo.bridge.link.access import router_access_control
from stopgo.bridge.link.authority import init_site, issue, listed, revoke, rotate
from stopgo.bridge.link.keys import Certificates, Holder, KeyFiles, Untrusted, common_name, now_utc, read_keys
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.zenoh_link import Guard, connecting, joining, listening
from stopgo.bridge.station.station import connect
from stopgo.command_line import main
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.station.test_fleet import router
from tests.bridge.world import corridor
from tests.ports import free_port


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return keys_of_site(tmp_path / "site")


def test_a_certificate_names_its_holder_and_its_role_apart(site: Path) -> None:
    keys = read_keys(site / "r1", now=now_utc())
    assert common_name(keys.certificate) == "robot:r1"
    assert (keys.holder.role, keys.holder.name) == ("robot", "r1")


def test_keys_of_an_older_kind_are_refused_with_the_remedy_and_can_be_renewed(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = authority._subject

    def older(common: str, organisation: str | None, unit: str | None = None) -> Any:
        return made(unit or common, common.partition(":")[2] if unit else organisation)

    monkeypatch.setattr(authority, "_subject", older)
    issue(site, "robot", "r9", now=now_utc())
    monkeypatch.undo()
    (site / "r9" / "revoked.json").unlink()
    with pytest.raises(InputError, match=r"names its role and not its holder.*stopgo keys rotate r9"):
        read_keys(site / "r9", now=now_utc())
    rotate(site, "r9", now=now_utc())
    assert read_keys(site / "r9", now=now_utc()).holder.name == "r9"


def test_new_keys_next_to_old_ones_until_those_are_revoked(site: Path) -> None:
    robot = Certificates(read_keys(site / "r1", now=now_utc()), now_utc)
    before = read_keys(site / "alice", now=now_utc())
    rotate(site, "alice", now=now_utc())
    after = read_keys(site / "alice", now=now_utc())
    assert robot.holder(before.der)[0].name == robot.holder(after.der)[0].name == "alice"
    assert revoke(site, "alice", old=True) == (before.holder.serial,)
    assert robot.holder(after.der)[0].name == "alice"
    with pytest.raises(Untrusted, match="alice is revoked"):
        robot.holder(before.der)
    states = [(one.holder.name, one.state, one.current) for one in listed(site, now=now_utc())]
    assert states[:2] == [("alice", "valid", True), ("alice", "revoked", False)]
    assert all(state == ("valid", True) for _, *state in map(list, states[2:]) for state in [tuple(state)])


def test_what_is_revoked_stays_so_with_an_older_a_forged_or_a_missing_list(site: Path) -> None:
    keys, alice, bob = (read_keys(site / who, now=now_utc()) for who in ("r1", "alice", "bob"))
    robot = Certificates(keys, now_utc)
    older = keys.files.revoked.read_bytes()
    revoke(site, "alice")
    with pytest.raises(Untrusted, match="revoked"):
        robot.holder(alice.der)
    newer = keys.files.revoked.read_bytes()
    for content in (older, newer.replace(b"1", b"2"), b"{}", b"\xff", None):
        keys.files.revoked.unlink(missing_ok=True)
        if content is not None:
            keys.files.revoked.write_bytes(content)
        with pytest.raises(Untrusted, match="revoked"):
            robot.holder(alice.der)
        assert robot.holder(bob.der)[0].name == "bob"
    with pytest.raises(InputError, match=r"revoked\.json: cannot be read.*copy it"):
        read_keys(site / "r1", now=now_utc())
    keys.files.revoked.write_bytes(newer.replace(b'"number":1', b'"number":9'))
    with pytest.raises(InputError, match="not signed by the authority"):
        read_keys(site / "r1", now=now_utc())


def test_what_is_revoked_stays_so_after_a_restart_with_an_older_list(site: Path, tmp_path: Path) -> None:
    keys, alice, state = read_keys(site / "r1", now=now_utc()), site / "alice", tmp_path / "state"
    der = read_keys(alice, now=now_utc()).der
    older = keys.files.revoked.read_bytes()
    revoke(site, "alice")
    with pytest.raises(Untrusted, match="revoked"):
        Certificates(keys, now_utc, state).holder(der)
    keys.files.revoked.write_bytes(older)
    assert Certificates(keys, now_utc).holder(der)[0].name == "alice", "what else would the state be for?"
    with pytest.raises(Untrusted, match="revoked"):
        Certificates(keys, now_utc, state).holder(der)
    revoke(site, "r1")
    with pytest.raises(Untrusted, match="revoked"):
        Certificates(keys, now_utc, state).holder(keys.der)
    keys.files.revoked.write_bytes(older)
    with pytest.raises(InputError, match="is revoked; issue new keys for r1"):
        read_keys(site / "r1", now=now_utc(), state=state)


def test_a_kept_list_that_is_damaged_is_reported_and_another_authoritys_is_not_looked_at(
    site: Path, tmp_path: Path
) -> None:
    keys, state = read_keys(site / "r1", now=now_utc()), tmp_path / "state"
    revoke(site, "alice")
    Certificates(keys, now_utc, state).holder(keys.der)
    (kept,) = state.iterdir()
    kept.write_bytes(kept.read_bytes().replace(b'"number":1', b'"number":0'))
    with pytest.raises(
        InputError, match=r"revoked-\w+\.json: the stored list .* is damaged; copy .* remove this one"
    ):
        read_keys(site / "r1", now=now_utc(), state=state)
    with pytest.raises(
        InputError, match=r"revoked-\w+\.json: the stored list .* is damaged; copy .* remove this one"
    ):
        Certificates(keys, now_utc, state)
    another = keys_of_site(tmp_path / "another")
    held = read_keys(another / "r1", now=now_utc(), state=state)
    assert Certificates(held, now_utc, state).holder(held.der)[0].name == "r1"


def test_a_revoked_station_reads_no_keys_and_is_not_obeyed(site: Path) -> None:
    field = GuardedField(site)
    station = field.guarded_station()
    station.push(corridor())
    revoke(site, "alice")
    for order in (lambda: station.command("pause"), station.status):
        with pytest.raises((NegativeResult, OutcomeUnknown), match="alice is revoked"):
            order()
    with pytest.raises(InputError, match="is revoked; issue new keys for alice"):
        read_keys(site / "alice", now=now_utc())


def test_a_revoked_robot_is_not_believed(site: Path) -> None:
    field = GuardedField(site)
    station = field.guarded_station()
    revoke(site, "r1")
    with pytest.raises(OutcomeUnknown, match="r1 is revoked"):
        station.status()


def test_a_key_that_others_may_read_is_refused(site: Path) -> None:
    for files in (KeyFiles(site / "alice"), KeyFiles(site / "authority")):
        assert files.key.stat().st_mode & 0o777 == 0o600
        files.key.chmod(0o640)
    with pytest.raises(InputError, match=r"alice/key\.pem: others may read or write it; chmod 600"):
        read_keys(site / "alice", now=now_utc())
    for act in (
        lambda: issue(site, "station", "carl", now=now_utc()),
        lambda: rotate(site, "alice", now=now_utc()),
        lambda: revoke(site, "alice"),
    ):
        with pytest.raises(InputError, match=r"authority/key\.pem: others may read or write it; chmod 600"):
            act()


@pytest.mark.parametrize("address", ["", "a b", "10.0.0.1/24", "-x", "x" * 300])
def test_an_address_that_is_none_is_named(site: Path, address: str) -> None:
    with pytest.raises(InputError, match="--address"):
        rotate(site, "r1", now=now_utc(), addresses=(address,))


def test_names_that_cannot_be_are_refused(site: Path) -> None:
    for name in ("", "a/b", "../x", "x" * 57, "authority"):
        with pytest.raises(InputError, match="name "):
            issue(site, "station", name, now=now_utc())
        with pytest.raises(InputError, match="holds no keys"):
            revoke(site, name)
    with pytest.raises(InputError, match="nobody connects to it"):
        issue(site, "viewer", "zoe", now=now_utc(), addresses=("10.0.0.1",))


def test_the_commands_make_list_renew_and_revoke_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(tmp_path / "site")

    def said(*words: str) -> str:
        assert main(["keys", *words]) == 0
        return capsys.readouterr().out

    said("init", folder)
    said("issue", "station", "alice", "--in", folder)
    said("rotate", "alice", "--in", folder)
    assert "1 revoked" in said("revoke", "alice", "--old", "--in", folder)
    assert "nothing to revoke" in said("revoke", "alice", "--old", "--in", folder)
    keys = json.loads(said("list", folder, "--json"))["keys"]
    assert [(key["name"], key["state"], key["current"]) for key in keys] == [
        ("alice", "valid", True),
        ("alice", "revoked", False),
    ]
    assert "revoked, replaced" in said("list", folder)
    for wrong in (("list",), ("list", folder, "--in", folder), ("issue", "king", "bob", "--in", folder)):
        assert main(["keys", *wrong]) == 2
    alice = str(tmp_path / "site" / "alice")
    listen, state = f"tls/127.0.0.1:{free_port()}", str(tmp_path / "state")
    assert main(["robot", "--name", "r1", "--listen", listen, "--state", state, "--keys", alice]) == 2
    assert "not of robot r1" in capsys.readouterr().err


def test_a_wrong_authority_and_a_wrong_address_are_distinguished_from_a_robot_that_is_off(
    site: Path, tmp_path: Path
) -> None:
    init_site(tmp_path / "other", now=now_utc())
    issue(tmp_path / "other", "station", "stranger", now=now_utc())
    port = free_port()
    listen, here, there = (f"tls/{host}:{port}" for host in ("0.0.0.0", "127.0.0.1", "127.0.0.2"))
    with robot_with(site, tmp_path, listen):
        for where, keys, why in (
            (here, tmp_path / "other" / "stranger", "not of the authority of these keys"),
            (there, site / "alice", r"not for 127\.0\.0\.2: .* --address"),
            (f"tls/127.0.0.1:{free_port()}", site / "alice", "nothing listens there"),
        ):
            unreached = connect(where, robot="r1", keys=keys, timeout_s=0.5)
            with pytest.raises(RobotUnreachable, match=why), unreached:
                pass
        plain = connect(f"tcp/127.0.0.1:{port}", robot="r1", timeout_s=0.5)
        with pytest.raises(RobotUnreachable, match=rf"it speaks TLS: write tls/127\.0\.0\.1:{port}"), plain:
            pass
    with listening(f"tcp/127.0.0.1:{port}"):
        unreached = connect(f"tcp/127.0.0.1:{port}", robot="r1", timeout_s=0.5)
        with pytest.raises(RobotUnreachable, match="is it running, under this name"), unreached:
            pass
    rotate(site, "r1", now=now_utc(), addresses=("127.0.0.2",))
    reached = connect(there, robot="r1", keys=site / "alice")
    with robot_with(site, tmp_path, listen), reached as station:
        assert station.status().state == "IDLE"


@contextmanager
def robot_with(site: Path, tmp_path: Path, listen: str) -> Iterator[None]:
    robot = start_robot("r1", tmp_path / "state", listen=listen, extra=("--keys", str(site / "r1")))
    try:
        yield
    finally:
        end_robot(robot)


def test_a_routers_rules_hold_each_robot_to_its_own_keys(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A robot with r2's keys cannot even answer on r1's, a viewer cannot order; r1 runs its mission."""
    issue(site, "router", "hub", now=now_utc())
    rules = tmp_path / "rules.json"
    assert main(["keys", "router-rules", "--in", str(site), "--site", "north"]) == 0
    rules.write_text(capsys.readouterr().out)
    endpoint, keys = f"tls/127.0.0.1:{free_port()}", KeyExpressions("r1", "north")
    extra = ("--connect", endpoint, "--keys", str(site / "r1"), "--site", "north")
    with router(endpoint, str(site / "hub"), str(rules)):
        impostor = Guard(read_keys(site / "r2", now=now_utc()), boot_id="b")
        with joining(endpoint, impostor) as other:
            asked: list[str] = []
            other.serve(f"{keys.root}/**", lambda request: asked.append(request.key) or b"{}")  # type: ignore[func-returns-value]
            other.announce(keys.alive)
            with pytest.raises(RobotUnreachable):
                connect(endpoint, robot="r1", site="north", keys=site / "alice", timeout_s=1.5).__enter__()
            robot = start_robot("r1", tmp_path / "state", listen=None, speed_up=100, extra=extra)
            try:
                with pytest.raises(RobotUnreachable, match="r1: robot name already in use at"):
                    start_robot("r1", tmp_path / "twin", listen=None, extra=extra)
                with connect(endpoint, robot="r1", site="north", keys=site / "alice") as station:
                    station.push(corridor())
                    with connecting(endpoint, Guard(read_keys(site / "vera", now=now_utc()))) as link:
                        assert link.ask(keys.command("abort"), timeout_s=1) is None
                    assert station.command("start").outcome == "ok"
                    reports = list(station.reports())
                with connect(endpoint, robot="r1", site="north", keys=site / "vera") as viewer:
                    assert viewer.status().state == "FINISHED"
            finally:
                end_robot(robot)
    assert len(reports) > 20
    assert asked == []


def test_rules_name_everybody_whose_keys_count_and_no_role_without_holders() -> None:
    def holder(role: str, name: str) -> Holder:
        later = now_utc() + timedelta(days=1)
        return Holder(role=role, name=name, serial="1", not_before=now_utc(), not_after=later)  # type: ignore[arg-type]

    rules = router_access_control([holder("robot", "r1"), holder("station", "alice")], None)
    names = [name for subject in rules["subjects"] for name in subject["cert_common_names"]]
    assert names == ["station:alice", "robot:r1"]
    assert len({rule["id"] for rule in rules["rules"]}) == len(rules["rules"])

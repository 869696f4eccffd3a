"""`stopgo runs --web`: the runs of a folder as pages of this machine."""

from __future__ import annotations

import os
import shutil
import socket
import struct
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import msgspec
import pytest
from rerun.chunk import RrdReader

from stopgo.command_line import main
from stopgo.recordings.catalog.run_index import INDEX, VERSION, IndexedFile, IndexedPlan, RunIndex, stamp_of
from stopgo.recordings.catalog.run_site import RunSite, listening, name_of
from stopgo.recordings.rrd.read import check
from tests.ports import free_port
from tests.recordings import run, world

MISSION = name_of(world.MISSION_ID)


@pytest.fixture(scope="module")
def site(sighted: Path, skipping: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunSite]:
    """The pages of a plan, a run and a broken file; served without Rerun's viewer."""
    place = tmp_path_factory.mktemp("runs")
    shutil.copy(sighted, place / "plan.rrd")
    shutil.copy(skipping, place / "run.rrd")
    (place / "<b>.rrd").write_bytes(b"RRF2junk")
    made = RunSite(place, "http://127.0.0.1:1", tmp_path_factory.mktemp("merged"))
    server = listening(made, free_port())
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    yield made
    server.shutdown()
    server.server_close()
    thread.join()


def asked(site: RunSite, path: str, *, host: str | None = None) -> tuple[int, dict[str, str], bytes]:
    address = site.address.removeprefix("http://")
    connection = HTTPConnection(address, timeout=60)
    connection.request("GET", path, headers={"Host": host or address})
    answer = connection.getresponse()
    told = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return told


def test_the_list_leads_to_each_missions_report_and_recording(site: RunSite) -> None:
    status, _, body = asked(site, "/")
    assert status == 200
    page = body.decode()
    assert run.RUN in page
    assert f'href="/{MISSION}.html"' in page
    recording = f"http%3A%2F%2F127.0.0.1%3A{site.address.rpartition(':')[2]}%2F{MISSION}.rrd"
    assert f'href="{site.viewer}/?url={recording}"' in page
    assert "&lt;b&gt;.rrd" in page
    assert "<b>.rrd" not in page


def test_plan_and_run_are_one_recording_behind_its_layout(site: RunSite, tmp_path: Path) -> None:
    status, headers, body = asked(site, f"/{MISSION}.rrd")
    assert (status, headers["Access-Control-Allow-Origin"]) == (200, site.viewer)
    head = body[:12]
    layout, merged = (head + part for part in body.split(head)[1:])
    (tmp_path / "layout.rbl").write_bytes(layout)
    kinds = {store.kind for store in RrdReader(tmp_path / "layout.rbl").blueprints()}
    assert kinds == {"blueprint"} and not RrdReader(tmp_path / "layout.rbl").recordings()
    (tmp_path / "merged.rrd").write_bytes(merged)
    assert check(tmp_path / "merged.rrd").properties.keys() >= {"plan", "run"}


def test_the_report_is_that_of_review(site: RunSite) -> None:
    status, _, body = asked(site, f"/{MISSION}.html")
    assert status == 200
    assert b"57.1" in body


@pytest.mark.parametrize("path", ["/other.rrd", "/../plan.rrd", "/plan.rrd", "/%2e%2e/plan.rrd", "/.html"])
def test_nothing_else_of_the_machine_is_there(site: RunSite, path: str) -> None:
    assert asked(site, path)[0] == 404


def test_who_calls_it_by_another_name_gets_nothing(site: RunSite) -> None:
    """A page of somebody else's may call this machine by a name of its own."""
    assert asked(site, "/", host="example.com")[0] == 403
    assert (
        asked(site, "/", host=site.address.removeprefix("http://").replace("127.0.0.1", "localhost"))[0]
        == 200
    )


def indexed(folder: Path, mission_id: str) -> None:
    """Let the folder's index tell that its plan is of a mission of this id."""
    size, changed_ns = stamp_of(folder / "plan.rrd")
    plan = IndexedPlan(mission_id=mission_id, revision=1, name="plan", stops=1, coverage=None)
    file = IndexedFile(size=size, changed_ns=changed_ns, plans=(plan,))
    (folder / INDEX).write_bytes(msgspec.json.encode(RunIndex(VERSION, {"plan.rrd": file})))


@pytest.mark.parametrize("mission_id", ["my mission", "site.v2", "../../up", "/etc/x", "a?b", "Größe"])
def test_a_mission_of_any_id_has_its_pages_and_stays_in_its_folder(
    sighted: Path, tmp_path: Path, mission_id: str
) -> None:
    for name in ("runs", "kept"):
        (tmp_path / name).mkdir()
    shutil.copy(sighted, tmp_path / "runs" / "plan.rrd")
    indexed(tmp_path / "runs", mission_id)
    site = RunSite(tmp_path / "runs", "http://127.0.0.1:1", tmp_path / "kept")
    assert f'href="/{name_of(mission_id)}.html"' in site.answer("/").body.decode()
    assert site.answer(f"/{name_of(mission_id)}.html").status == 200
    assert site.answer(f"/{name_of(mission_id)}.rrd").status == 200
    assert {path.name for path in tmp_path.iterdir()} == {"runs", "kept"}


def test_a_run_that_is_copied_with_its_old_date_is_in_the_recording(
    sighted: Path, skipping: Path, tmp_path: Path
) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "runs").mkdir()
    shutil.copy(sighted, tmp_path / "runs" / "plan.rrd")
    site = RunSite(tmp_path / "runs", "http://127.0.0.1:1", tmp_path / "kept")
    alone = site.answer(f"/{MISSION}.rrd").body
    shutil.copy(skipping, tmp_path / "runs" / "run.rrd")
    os.utime(tmp_path / "runs" / "run.rrd", (1e9, 1e9))
    assert site.answer(f"/{MISSION}.rrd").body != alone


def test_a_folder_that_goes_away_is_told_on_the_page(tmp_path: Path) -> None:
    answer = RunSite(tmp_path / "gone", "http://127.0.0.1:1", tmp_path).answer("/")
    assert answer.status == 409
    assert b"not a folder" in answer.body


def test_a_browser_that_goes_away_is_no_error(site: RunSite, capsys: pytest.CaptureFixture[str]) -> None:
    host, port = site.address.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as browser:
        browser.sendall(b"GET / HTTP")
        browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    assert asked(site, "/")[0] == 200
    assert not capsys.readouterr().err


def test_a_port_needs_web_and_must_be_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(tmp_path), "--port", "8000"]) == 2
    assert main(["runs", str(tmp_path), "--web", "--port", "99999"]) == 2
    assert main(["runs", str(tmp_path / "nowhere"), "--web"]) == 2
    assert capsys.readouterr().err.count("stopgo: ") == 3

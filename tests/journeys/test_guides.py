"""Every command of the guides and the README runs as it is written, or is listed with a reason."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from stopgo.batches import engine
from stopgo.batches.work import work
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.mission.files.mission_json import read
from stopgo.mission.run.events import Pose
from stopgo.planner.floors.ifc import loading
from tests.batches.inline_engine import InlineEngine
from tests.bridge.guarded import keys_of_site
from tests.called import stopgo
from tests.journeys.guides import PAGES, ROOT, VEHICLE, GuideFolder, blocks_of, commands_of, place
from tests.planner.floors.ifc.conftest import in_process
from tests.planner.floors.ifc.house import House
from tests.planner.floors.ifc.house import two_rooms as house_of_two_rooms
from tests.planner.floors.ifc.test_status import WORK, scheduled
from tests.planner.floors.test_robot_maps import map_in
from tests.planner.floors.test_robot_maps import two_rooms as map_of_two_rooms
from tests.recordings.conftest import write_field
from tests.recordings.logs.writing import odometry_rows, write_bag
from tests.recordings.replay.driving import driven
from tests.site.two_rooms import two_rooms

ORIGIN = "47.3769,8.5417,408,0"

ELSEWHERE = {
    r"pip|pipx|uv": "installs packages: make wheels does, in fresh environments",
    r"make (demo|test|docs|wheels)": "builds the environment, and runs these tests themselves",
    r"(\S+=\S+ )?\.venv/bin/python -m pytest": "runs other tests of this suite",
    r"dask (scheduler|worker)": "a program of others",
    r"stopgo batch .*--scheduler": "needs a cluster of dask: tests/batches/test_cluster.py",
    r"rerun|stopgo review .*--view": "opens a window: tests/recordings/viewing",
    r"stopgo review .*--png": "needs a driver of graphics: tests/recordings/viewing/test_headless.py",
    r"#!/bin/sh": "slows a third-party robot's disk: tests/bridge/conform/test_conform_slow_disk.py",
    r"stopgo conform station": "tests a third-party station: tests/bridge/conform/test_conform_station.py",
    r"stopgo site .*--listen": "needs an address of a local network: tests/site/test_web_server.py",
    r"python docs/query_runs.py": "tests/recordings/test_query.py runs it",
    r"(sudo apt|python3 -m venv|source) ": "prepares a computer with ROS 2",
    r"~/stopgo/bin/stopgo robot|stopgo (status|watch|doctor) --ros2": "needs ROS 2: tests/ros2, in make ros2",
    r"stopgo robot .*ros2-zenoh|stopgo guard": "needs Nav2: tests/bridge/ros2/test_ros2_zenoh_robot.py",
    r"cat ": "prints a file of the guide",
}
"""Commands that do not run here, and the reason."""

ENDS = {
    r"stopgo (session|site|tunnel) ": 130,
    r"stopgo conform robot ": 3,
    r"stopgo status .*--roster": 1,
}
"""Exit codes other than 0, as the guides have them: ended by Ctrl-C; no restart of the robot, so no pass;
robots that are expected and not found."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A floor, and its plan with a position on earth."""
    folder = tmp_path_factory.mktemp("guides")
    floor = two_rooms(folder / "floor.dxf")
    shutil.copy(floor, folder / "office.dxf")
    done = stopgo("plan", str(floor), "-o", str(folder / "plan"), "--origin", ORIGIN, "--range", "3")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def guide(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GuideFolder]:
    """A folder with the files that the guides name, outside of which no command writes."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    shutil.copytree(files / "plan", tmp_path / "out")
    shutil.copy(files / "plan" / "mission.json", tmp_path)
    shutil.copy(files / "plan" / "plan.rrd", tmp_path)
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "samples").symlink_to(ROOT / "recordings" / "samples")
    monkeypatch.setattr(engine, "LocalEngine", lambda workers: InlineEngine(workers, work))
    monkeypatch.setattr(loading, "_run", in_process)
    with place(tmp_path) as made:
        yield made


def with_models(guide: GuideFolder) -> None:
    """A model of two storeys whose parts were built one after another, and a robot's map."""
    house = house_of_two_rooms_on_time()
    level = house.storey("Level 1", 3.3)
    _room(house, level, 3.3)
    house.write(guide.folder / "building.ifc")
    wall = house.things["middle"].GlobalId
    (guide.folder / "work.csv").write_text(f"GlobalId,Start,Finish\n{wall},2024-03-01,2024-03-31\n")
    map_in(guide.folder, map_of_two_rooms())


def _room(house: House, level: object, z: float) -> None:
    """A walled room of 6 × 4 m."""
    house.box("IfcSlab", "upper slab", (0, 0, z - 0.2, 6.4, 4.4, z), level)
    walls = ((0, 0, 6.4, 0.2), (0, 4.2, 6.4, 4.4), (0, 0.2, 0.2, 4.2), (6.2, 0.2, 6.4, 4.2))
    for number, (x0, y0, x1, y1) in enumerate(walls):
        house.box("IfcWall", f"upper {number}", (x0, y0, z, x1, y1, z + 2.7), level)
    house.box("IfcSpace", "upper room", (0.2, 0.2, z, 6.2, 4.2, z + 2.7), level)


def with_keys(guide: GuideFolder) -> None:
    """Keys of a robot and its operators, and a robot to reach."""
    keys_of_site(guide.folder / "keys")
    shutil.copytree(guide.folder / "keys" / "r1", guide.folder / "etc")
    guide.words |= {"/etc/stopgo/keys": "etc", "/var/lib/stopgo": "state"}
    (guide.folder / "robots.toml").write_text('robots = ["r1", "r2", "r3"]\n')


def with_robot(guide: GuideFolder) -> None:
    """A robot with keys, and one without."""
    with_keys(guide)
    assert guide.run("stopgo robot --name r1 --state r1.state --speed-up 20").returncode == 0


def with_vehicle(guide: GuideFolder, *, has_origin: bool = True) -> None:
    """A simulated rover at the start of the mission."""
    mission = read(guide.folder / "mission.json")
    at = Pose(x=mission.start.x, y=mission.start.y, heading=mission.start.heading)
    origin = mission.georeference if has_origin else None
    setup = VehicleSetup(PROFILES["ardupilot"], origin=origin, at=at)
    guide.ends.enter_context(vehicle_on(VEHICLE, setup))


def with_own_run(guide: GuideFolder) -> None:
    """A rover that drives by itself, whose stops are as far off as an autopilot's may be."""
    planned = guide.run(f"stopgo plan floor.dxf -o out --origin {ORIGIN} --range 3 --tolerance 0.5")
    assert planned.returncode == 0
    with_vehicle(guide)


def with_gateway(guide: GuideFolder) -> None:
    with_keys(guide)
    with_vehicle(guide)
    guide.words["mavlink:serial:/dev/ttyAMA0:921600"] = "mavlink:udpout:127.0.0.1:14550"


def with_vehicles(guide: GuideFolder) -> None:
    """A robot, and the guide's roster of vehicles."""
    with_robot(guide)
    with_vehicle(guide)
    (roster,) = blocks_of("how-to/site.md", "toml")
    (guide.folder / "robots.toml").write_text(roster, encoding="utf-8")
    (guide.folder / "rover.key").write_text("0123456789abcdef" * 4)
    (guide.folder / "rover.key").chmod(0o600)


def with_radio(guide: GuideFolder) -> None:
    guide.words["serial:/dev/ttyAMA1:57600"] = "udpin:127.0.0.1:14551"


def with_parameters(guide: GuideFolder) -> None:
    (guide.folder / "plan.toml").write_text("[robot]\nspeed = 0.4\n")


def with_plugins(guide: GuideFolder) -> None:
    """The modules of the guide, in the working folder."""
    lab, robot, *_ = blocks_of("how-to/plugins.md", "python")
    (guide.folder / "my_lab.py").write_text(lab, encoding="utf-8")
    (guide.folder / "my_robot.py").write_text(robot, encoding="utf-8")
    guide.patch.syspath_prepend(guide.folder)
    guide.ends.callback(lambda: [sys.modules.pop(name, None) for name in ("my_lab", "my_robot")])


def with_campus(guide: GuideFolder) -> None:
    """The guide's two files in one, with the floors and paths that they name."""
    batch, day = blocks_of("how-to/campus.md", "toml")
    (guide.folder / "plans.toml").write_text(f"{batch}\n{day}", encoding="utf-8")
    (guide.folder / "transfers.csv").write_text("from,to,minutes\ntower/EG,hall,5\n")
    for name in ("models", "drawings"):
        (guide.folder / name).mkdir()
    house_of_two_rooms_on_time().write(guide.folder / "models" / "tower.ifc")
    shutil.copy(guide.folder / "floor.dxf", guide.folder / "drawings" / "hall.dxf")


def house_of_two_rooms_on_time() -> House:
    """Two rooms whose parts are finished one after another until May 2024."""
    return scheduled(house_of_two_rooms(), WORK | {"middle": ("2024-05-06", "2024-05-17")})


def with_runs(guide: GuideFolder) -> None:
    """The recording of a run of the plan."""
    write_field(guide.folder / "field.rrd", read(guide.folder / "mission.json"))
    for name in ("plan.rrd", "field.rrd"):
        shutil.copy(guide.folder / name, guide.folder / "recordings")


def with_log(guide: GuideFolder) -> None:
    """The log of a robot that has driven a mission on the sample floor."""
    shutil.copy(ROOT / "recordings" / "samples" / "office.dxf", guide.folder)
    assert guide.run("stopgo plan office.dxf -o plan --coverage 0.3").returncode == 0
    drive = driven(read(guide.folder / "plan" / "mission.json"))
    poses = [(x, y, heading) for _, x, y, heading in drive.rows[::4]]
    write_bag(guide.folder / "field.bag", odometry_rows(poses, ros2=False, step_ns=4 * 10**8))


PREPARED: dict[str, Callable[[GuideFolder], None]] = {
    "floors": with_models, "conform": with_robot, "deployment": with_keys, "gateway": with_gateway,
    "replay": with_log, "push-to-autopilot": lambda guide: with_vehicle(guide, has_origin=False),
    "run-on-autopilot": with_own_run, "tunnel": with_radio, "plugins": with_plugins, "campus": with_campus,
    "review": with_runs, "exports": with_parameters, "nav2": with_robot, "README": with_robot,
    "site": with_vehicles,
}  # fmt: skip


@pytest.mark.parametrize("page", [page for page in PAGES if commands_of(page)], ids=lambda page: page.stem)
def test_the_commands_of_a_guide_run_as_they_are_written(page: Path, guide: GuideFolder) -> None:
    PREPARED.get(page.stem, lambda guide: None)(guide)
    for command in commands_of(page):
        if any(re.match(pattern, command) for pattern in ELSEWHERE):
            continue
        if "--day " in command:  # as the guide says: one variant of each floor
            _leave_out(guide.folder / "plans.toml", "matrix")
        done = guide.run(command)
        code = next((code for pattern, code in ENDS.items() if re.match(pattern, command)), 0)
        said = f"{done.stdout[-2000:]}{done.stderr[-2000:]}"
        assert done.returncode == code, f"{command}: {said} (what cannot run here belongs in ELSEWHERE)"


def _leave_out(path: Path, word: str) -> None:
    """Remove the line that begins with a word."""
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith(word)), encoding="utf-8")


def test_every_listed_command_is_in_a_guide_and_its_test_exists() -> None:
    every = [command for page in PAGES for command in commands_of(page)]
    for pattern, reason in ELSEWHERE.items():
        assert any(re.match(pattern, command) for command in every), f"{pattern}: in no guide any more"
        for path in re.findall(r"tests/[\w/.]+", reason):
            assert (ROOT / path).exists(), path

"""Plug-ins take part in a plan, and where one misbehaves a line says so."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stopgo
from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.plugin_body import GuardedBase, GuardedScanner, plugin_body
from stopgo.command_line import main
from stopgo.mission.console.plugins import Variant
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.run.scans import ScanResult
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.floors import read_floor
from stopgo.planner.selection.refine import MOST
from tests.bridge.world import WALKING, corridor
from tests.planner.worlds import two_rooms

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "how-to" / "plugins.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
COMMANDS = re.findall(r"^```sh\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)

FLOOR = two_rooms(0.9)
QUICK = {"register": False, "refine": False}
"""Settings of a plan that calls every plug-in, and does no more."""
Write = Callable[[str, str], None]


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Writes a module into the working folder."""
    monkeypatch.chdir(tmp_path)
    before = set(sys.modules)

    def write(name: str, code: str) -> None:
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")

    yield write
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def test_the_example_of_the_guide_plans_and_exports(
    module: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module("my_lab", BLOCKS[0])
    shutil.copy(ROOT / "recordings" / "samples" / "office.dxf", tmp_path)
    for line in COMMANDS[0].splitlines():
        assert main(shlex.split(line)[1:]) == 0, capsys.readouterr().err
    mission = stopgo.read_mission("plan/mission.json")
    assert len((tmp_path / "stops.txt").read_text().splitlines()) == len(mission.stops)
    assert mission.origin.parameters["selector"] == "my_lab:most_first"
    assert main(["check", "plan/mission.json", "--floor", "office.dxf"]) == 0


NUMPY = "import numpy as np\n"
WRONG: dict[str, tuple[str, str, str]] = {
    "not there": ("candidates", "", "cannot|has no attribute 'f'"),
    "broken code": ("candidates", "def f(:", "SyntaxError: invalid syntax"),
    "fails on import": ("candidates", "1 / 0", r"ZeroDivisionError: division by zero \(bad.py, line 1\)"),
    "no function": ("candidates", "f = 3", "is a int, not a function"),
    "raises": ("candidates", "def f(space):\n    return {}['x']", r"KeyError: 'x' \(bad.py, line 2\)"),
    "nothing": ("candidates", "def f(space): pass", r"gave nothing, not \(xy, room\)"),
    "one thing": ("candidates", "def f(space): return [(1, 1)]", r"gave a list, not \(xy, room\)"),
    "no numbers": ("candidates", "def f(space): return [('a', 'b')], [0]", "xy is a list, not numbers"),
    "three columns": (
        "candidates", NUMPY + "def f(space): return np.ones((2, 3)), [0, 0]",
        r"xy has the shape \(2, 3\), not \(n, 2\)",
    ),
    "no place": (
        "candidates", NUMPY + "def f(space): return np.full((2, 2), np.nan), [0, 0]",
        "xy has 4 numbers that are not finite",
    ),
    "no such room": ("candidates", "def f(space): return [(1, 1)], [99]", "room holds 99, not whole numbers"),
    "rooms missing": (
        "candidates", "def f(space): return [(1, 1), (2, 2)], [0]", r"room has the shape \(1,\), not \(2,\)",
    ),
    "sees nothing": ("visibility", "def f(found): return None", "gave nothing, not a Visibility"),
    "sees what is not": (
        "visibility",
        NUMPY + "from stopgo.mission.stages import Visibility\ndef f(found):\n"
        "    n = len(found.kept)\n"
        "    one = np.zeros(n, dtype=int)\n"
        "    return Visibility(found, np.arange(n + 1), one, one, one + 10**9, 'x')",
        "last holds 1e.09, not whole numbers",
    ),
    "ways of words": (
        "graph",
        "from stopgo.planner.routing.paths import Paths\n"
        "def f(space, points): return Paths(points, [['a']], None)",
        "ValueError: could not convert string to float",
    ),
    "covers too little": ("selector", "def f(cover, settings): return [], 0", "its 0 rows leave . of the"),
    "bound above": (
        "selector", "def f(cover, settings): return list(range(cover.rows)), cover.rows + 1", "bound holds",
    ),
    "rows twice": ("selector", "def f(cover, settings): return [0, 0], 1", "gave a row twice"),
    "no rows": ("selector", "def f(cover, settings): return [0.5], 1", "rows holds 0.5, not whole numbers"),
    "half a tour": ("router", "def f(lengths, *, seed): return [0]", "order has the shape"),
    "stays": ("router", "def f(lengths, *, seed): return [0] * len(lengths)", "route visits a point twice"),
    "old signature": ("router", "def f(lengths): return []", "TypeError: f.. got an unexpected"),
    "no ways": ("graph", "def f(space, points): return 3", "gave a int, not a Paths"),
    "in the words of 0.1": (
        "graph",
        "from stopgo.planner.routing.ways import Ways\n"
        "def f(space, points): return Ways(points, [['a']], None)",
        "ValueError: could not convert string to float",
    ),
    "through the wall": (
        "graph",
        NUMPY + "from itertools import combinations\n"
        "from stopgo.planner.routing.paths import shortest_paths\n"
        "def f(space, points):\n"
        "    n = len(points)\n"
        "    return shortest_paths(points, np.array(list(combinations(range(n), 2))), n)",
        "leg to .* is too close to an obstacle or an edge",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_plug_in_that_misbehaves_is_named_in_one_line(case: str, module: Write) -> None:
    stage, code, said = WRONG[case]
    module("bad", code)
    settings = Settings(**{stage: "bad:f"}, range=2.0, room_coverage=0.9, **QUICK)  # type: ignore[arg-type]
    with pytest.raises(StopgoError, match=f"^--{stage} bad:f: .*(?:{said})") as caught:
        plan(FLOOR, settings)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("stage", ["candidates", "visibility", "selector", "router", "graph"])
@pytest.mark.parametrize("name", ["luck", "no.such.module:f", ":f", "x:"])
def test_a_variant_that_is_not_there_is_named(stage: str, name: str) -> None:
    with pytest.raises(InputError, match=f"^--{stage} {name}: "):
        plan(FLOOR, Settings(**{stage: name}, **QUICK))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "old", ["mission.events", "planner.routing.paths", "recordings.logs", "bridge.robot.base"]
)
def test_an_import_path_of_the_first_release_is_named_with_todays(
    module: Write, old: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module("older", f"from {old} import Anything\ndef f(space): return space")
    checkout = {"", str(ROOT)}  # where the folders are found by their old names
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place not in checkout])
    monkeypatch.chdir(tmp_path)
    folder = old.partition(".")[0]
    with pytest.raises(InputError) as caught:
        plan(FLOOR, Settings(candidates="older:f"))
    line = str(caught.value)
    assert f"imports {folder}, a package of stopgo 0.1; import stopgo.{folder} instead" in line
    assert ("stopgo.mission.run.events" in line) == (folder == "mission")
    assert line.endswith("(older.py, line 1)")


def test_a_method_added_to_the_dictionary_is_called_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    from stopgo.planner.routing import ROUTERS
    from stopgo.planner.selection import METHODS

    monkeypatch.setitem(METHODS, "mine", METHODS["greedy"])
    monkeypatch.setitem(ROUTERS, "mine", ROUTERS["default"])
    made = plan(FLOOR, Settings(selector="mine", router="mine")).first
    assert made.selection.method.startswith("mine")
    assert made.route.method.startswith("mine")


def test_what_a_plug_in_sees_may_be_lists(module: Write) -> None:
    module(
        "lists",
        "from dataclasses import replace\nfrom stopgo.planner.visibility.exact_sight import exact\n"
        "def f(found):\n"
        "    seen = exact(found)\n"
        "    runs = {k: getattr(seen, k).tolist() for k in ('pointer', 'segment', 'first', 'last')}\n"
        "    return replace(seen, method='lists', **runs)",
    )
    one = plan(FLOOR, Settings(visibility="lists:f", range=2.0)).first
    other = plan(FLOOR, Settings(range=2.0)).first
    assert np.array_equal(one.selection.xy, other.selection.xy)


def test_paths_of_a_plug_in_may_be_rounded_otherwise_in_each_direction(module: Write) -> None:
    module(
        "lab",
        "from stopgo.planner.routing.grid_graph import grid_paths\n"
        "def f(space, points): return grid_paths(space, points)",
    )
    one, other = (plan(FLOOR, Settings(graph=name, range=2.0, **QUICK)).first for name in ("lab:f", "grid"))  # type: ignore[arg-type]
    assert [leg.tolist() for leg in one.route.approaches] == [leg.tolist() for leg in other.route.approaches]


def test_a_bound_of_a_plug_in_is_reported_as_its_own(module: Write) -> None:
    module("honest", NUMPY + "def f(cover, settings): return np.arange(cover.rows), cover.rows")
    made = plan(FLOOR, Settings(selector="honest:f", refine=False, register=False))
    assert made.selection.method == "honest:f, fewest as reported"


def test_a_selector_that_chooses_many_stops_is_offered_no_more_positions(module: Write) -> None:
    code = (
        "rows = []\ndef f(cover, settings):\n    rows.append(cover.rows)\n    return np.arange(cover.rows), 0"
    )
    module("many", NUMPY + code)
    plan(FLOOR, Settings(selector="many:f", grid=0.5))
    offered = set(sys.modules["many"].rows)
    assert len(offered) == 1 and min(offered) > MOST


def entry(monkeypatch: pytest.MonkeyPatch, group: str, name: str, value: str) -> None:
    """An installed package that brings an entry point."""
    there = metadata.entry_points

    def with_ours(**asked: str) -> Any:
        mine = [metadata.EntryPoint(name, value, group)] if asked.get("group") == group else []
        return [*there(**asked), *mine]

    monkeypatch.setattr(metadata, "entry_points", with_ours)


def test_an_installed_package_brings_variants_by_name(module: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    module("brought", NUMPY + "def order(lengths, *, seed): return np.arange(len(lengths))")
    entry(monkeypatch, "stopgo.router", "as-drawn", "brought:order")
    assert plan(FLOOR, Settings(router="as-drawn")).route.method.startswith("as-drawn")
    with pytest.raises(InputError, match="known: default, aco, as-drawn, or module:function"):
        plan(FLOOR, Settings(router="walk"))


READER = """
from stopgo.mission.floor import FloorPlan
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.geometry import Polygon
from stopgo.planner.floors.reader import Reader

def read(file, options):
    given = file.data.decode()
    if given == "fails":
        raise RuntimeError("out of paper")
    if given == "list":
        outline = (Polygon([(0, 0), (1, 1), (0, 1)]),)
    else:
        outline = () if given == "empty" else (Polygon.of([(0, 0), (1, float(given)), (0, 1)]),)
    source = FloorSource("a", "f" * 64) if given == "2" else file.source()
    return 3 if given == "3" else FloorPlan("sketch", source, outline)

READER = Reader("sketch", (".sketch",), lambda data: False, "paper", frozenset())
"""


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("fails", r"RuntimeError: out of paper \(paper.py, line 10\)"),
        ("empty", "gave a floor without an outline"),
        ("list", "a ring is a list, not an array"),
        ("nan", "a ring has 1 numbers that are not finite"),
        ("2", "gave the floor of another file"),
        ("3", "gave a int, not a FloorPlan"),
    ],
)
def test_a_reader_of_floors_is_brought_and_checked(
    data: str, said: str, module: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    module("paper", READER)
    entry(monkeypatch, "stopgo.floor", "sketch", "paper:READER")
    monkeypatch.syspath_prepend(".")
    Path("a.sketch").write_text("1")
    assert isinstance(read_floor(Path("a.sketch")), FloorPlan)
    Path("a.sketch").write_text(data)
    with pytest.raises(InputError, match=f"^floor reader sketch: {said}"):
        read_floor(Path("a.sketch"))
    Path("a.other").write_text("1")
    with pytest.raises(InputError, match=r"floors are read from .*\.dxf.*, \.sketch"):
        read_floor(Path("a.other"))


@pytest.mark.parametrize(
    ("write", "read", "said"),
    [
        ("b''", "[]", "3 stops were written but 0 read back"),
        ("'text'", "[]", "gave a str, not a bytes"),
        ("1 / 0", "[]", "ZeroDivisionError"),
        ("b'x'", "[(float('nan'), 0)] * 3", "read_back has 3 numbers that are not finite"),
        ("b'x'", "[(0, 0)] * 3", "reads back 2.000000 m off"),
    ],
)
def test_a_format_is_read_back(
    write: str, read: str, said: str, module: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    module(
        "notes",
        "from stopgo.mission.files.exports.format import Format\n"
        f"FORM = Format('.n', 'notes', lambda m, s: {write}, lambda d, m, s: {read}, tolerance=1e9)",
    )
    stopgo.write_mission(corridor(), "mission.json")
    assert main(["export", "mission.json", "--to", "notes:FORM", "-o", "x.n"]) == 2
    told = capsys.readouterr().err
    assert re.search(said, told)
    assert len(told.splitlines()) == 1
    assert not Path("x.n").exists()


def test_the_controller_of_the_guide_drives(module: Write, tmp_path: Path) -> None:
    module("my_robot", BLOCKS[1])
    with plugin_body("my_robot:controller", tmp_path)(SimulatedClock()) as body:
        limits = WALKING
        assert body.base.goto([(0, 0), (1, 2)], heading=None, limits=limits, interrupt=Event()) == "arrived"
        assert (body.base.pose().x, body.base.pose().y) == (1, 2)
        assert body.base.not_ready() == ""


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def f(state): return 1, 2", "its int is no Base: it lacks pose, speed, battery"),
        ("def f(state): return 1", r"gave a int, not \(base, scanner\)"),
        (f"{BLOCKS[1]}\nBase.pose = lambda self: 7\ndef f(state): return Base(), Scanner()", "answered 7"),
    ],
)  # fmt: skip
def test_a_controller_that_is_none_is_refused(code: str, said: str, module: Write, tmp_path: Path) -> None:
    module("odd", code)
    opened = plugin_body("odd:f", tmp_path)(SimulatedClock())
    with pytest.raises(InputError, match=f"^--controller odd:f: {said}"), opened:
        raise AssertionError("was taken")


def test_a_base_that_fails_is_stopped_and_drives_no_more() -> None:
    stops: list[str] = []

    def fail(*_: Any, **__: Any) -> Any:
        raise ValueError("motor 2 is hot")

    base: Any = SimpleNamespace(goto=fail, stop=lambda: stops.append("stop"), pose=lambda: np.nan)
    guarded = GuardedBase(Variant("--controller my:robot", "my:robot", base, ours=False), base)
    limits = WALKING
    assert guarded.goto([(0, 0)], heading=None, limits=limits, interrupt=Event()) == "blocked"
    assert stops == ["stop"]
    assert guarded.blocked_by().startswith("--controller my:robot: ValueError: motor 2 is hot")
    assert guarded.not_ready() == guarded.blocked_by()
    base.goto = lambda *_, **__: "arrived"
    assert guarded.goto([(0, 0)], heading=None, limits=limits, interrupt=Event()) == "blocked"
    guarded.stop()
    assert stops == ["stop", "stop"]
    base.stop = fail
    with pytest.raises(InputError, match="my:robot: ValueError: motor 2 is hot"):
        guarded.stop()


@pytest.mark.parametrize("name", ["scan_outcome", "what_became"])
def test_a_scanner_reports_an_interrupted_scan_by_the_new_or_the_former_name(name: str) -> None:
    ended = ScanResult(file="a.e57", size=1, sha256="0" * 64, points=1)
    scanner: Any = SimpleNamespace(**{name: lambda label: ended if label == "a" else None})
    guarded = GuardedScanner(Variant("--controller my:robot", "my:robot", scanner, ours=False), scanner)
    assert (guarded.scan_outcome("a"), guarded.scan_outcome("b")) == (ended, None)


LOG = """
import numpy as np
from stopgo.recordings.logs import FieldLog, LogFormat
from stopgo.recordings.logs.field_log import Poses

def read(path, how):
    given = path.read_text()
    times = np.array([2, 1] if given == "back" else [1, 2])
    xy = np.array([[0, 0], [1, np.nan if given == "nan" else 1]], dtype=float)
    poses = Poses("odometer", "map", times, xy, np.array([np.nan, 0.0]))
    if given == "fails":
        raise RuntimeError("out of tape")
    clock = "sun" if given == "sun" else "wall"
    return FieldLog(str(path), "tape", "f" * 64, 2, clock, 1, 2, poses=(poses,))

FORMAT = LogFormat("tape", (".tape",), (), lambda: read)
"""


def test_a_kind_of_log_is_brought_and_checked(module: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    from stopgo.recordings.logs import read_log

    module("tapes", LOG)
    entry(monkeypatch, "stopgo.log", "tape", "tapes:FORMAT")
    Path("a.tape").write_text("good")
    assert len(read_log(Path("a.tape")).poses[0].ns) == 2
    wrong = {
        "back": "the times of odometer are not in order",
        "nan": "the positions of odometer has 1 numbers that are not finite",
        "fails": r"RuntimeError: out of tape \(tapes.py, line 12\)",
        "sun": "its clock is 'sun'; known: wall, since boot, simulated",
    }
    for content, said in wrong.items():
        Path("a.tape").write_text(content)
        with pytest.raises(InputError, match=f"^log reader tape: {said}"):
            read_log(Path("a.tape"))
    Path("a.film").write_text("good")
    with pytest.raises(InputError, match=r"known are \.bag, .*, \.tape$"):
        read_log(Path("a.film"))

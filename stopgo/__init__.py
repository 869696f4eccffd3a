"""stopgo from Python: read a floor, plan it, check and export the mission, and send it to a robot.

    import stopgo

    plan = stopgo.plan("floor.dxf", range=8.0)
    stopgo.write_mission(plan.mission, "mission.json")

Lengths are metres, angles radians counter-clockwise from +x, times seconds. Every result is frozen;
arrays are read-only. Paths may be `str` or `Path`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from stopgo.batches import PlannedBatch
    from stopgo.bridge.station.follow import Followed
    from stopgo.bridge.station.station import Station
    from stopgo.mission.document import Mission
    from stopgo.mission.document.problems import Problem
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.plan import Plan
    from stopgo.mission.settings import Settings
    from stopgo.recordings.replay.replayed import Replay

FOLDERS = ("mission", "planner", "bridge", "recordings")
"""The folders of the tree that lie below this package."""
_HERE = Path(__file__).parent


def settings(parameters: str | Path | None = None, **changes: Any) -> Settings:
    """Return the parameters of a plan: defaults, then a plan.toml, then `changes` by name.

    Raises
    ------
    InputError
        Naming the file or parameter, its value and what would be right.
    """
    from stopgo.mission.files.plan_toml import read_settings

    return read_settings(None if parameters is None else Path(parameters), changes)


def read_floor(path: str | Path, *, layers: Mapping[str, str] | None = None, **options: Any) -> FloorPlan:
    """Read the floor in a file, in metres.

    `layers` gives the kinds of layers with other names, such as `{"A-WALL": "walls", "DIM": "ignore"}`;
    `options` are the others of stopgo.planner.floors.FloorOptions, such as `d_dis` for how curves are cut.

    Raises
    ------
    InputError
        Naming the file, the problem, and the remedy.
    """
    from stopgo.planner.floors import FloorOptions
    from stopgo.planner.floors import read_floor as read

    kinds = {name.upper(): role for name, role in (layers or {}).items()}
    return read(Path(path), FloorOptions(layers=kinds, **options))


def plan(
    floor: FloorPlan | str | Path,
    given: Settings | None = None,
    *,
    all_parts: bool = False,
    observe: Callable[[Any], None] = lambda noun: None,
    **changes: Any,
) -> Plan:
    """Plan the scan stops of a floor, and the route by which a robot visits them.

    Parameters
    ----------
    floor
        A floor, or the file it is drawn in.
    given
        All parameters; or name those that are not the default as `changes`, such as `range=8.0`.
    all_parts
        Also plan parts of the floor that are not connected with the first.
    observe
        Called with the result of each stage as soon as it is there; with the selection of a large floor again
        after the figures, when its bound is known.

    Raises
    ------
    NegativeResult
        No target, no candidate, no visible target, or the required coverage cannot be reached.
    InputError
        A file, parameter or position that does not fit.
    """
    from stopgo.planner import plan as planned
    from stopgo.planner.floors import options_of
    from stopgo.planner.floors import read_floor as read

    if given is not None and changes:
        raise TypeError(f"give `settings`, or parameters by name, not both: {', '.join(changes)}")
    used = settings(**changes) if given is None else given
    if isinstance(floor, str | Path):
        floor = read(Path(floor), options_of(used))
    return planned(floor, used, observe=observe, all_parts=all_parts)


def batch(
    file: str | Path,
    out: str | Path,
    *,
    store: str | Path | None = None,
    workers: int = 2,
    scheduler: str | None = None,
) -> PlannedBatch:
    """Begin to plan all entries of a batch's file in the background; returns a future for each entry.

    Parameters
    ----------
    store
        Folder of finished plans, which several machines may share; else `.store` in `out`.
    workers
        Plans at the same time on this machine, unless `scheduler` is the address of a dask scheduler.

    Raises
    ------
    InputError
        With one line for each fault of the file; nothing is planned then.
    """
    from stopgo.batches import start_batch

    return start_batch(file, out, store=store, workers=workers, scheduler=scheduler)


def read_mission(path: str | Path) -> Mission:
    """Read a mission.json strictly: an unknown key, a wrong type or a wrong digest is an InputError."""
    from stopgo.mission.files.mission_json import read

    return read(Path(path))


def write_mission(mission: Mission, path: str | Path) -> None:
    """Write a mission.json whole or not at all."""
    from stopgo.mission.files.mission_json import write

    write(mission, Path(path))


def check(mission: Mission, floor: str | Path | None = None) -> tuple[Problem, ...]:
    """Return the problems of a mission; with a floor's file, also those of the mission on that floor."""
    from stopgo.mission.document.problems import problems_of

    problems = problems_of(mission)
    if floor is None:
        return problems
    from stopgo.planner.checking.verdict import verdict

    return (*problems, *verdict(mission, Path(floor), None).problems)


def export(mission: Mission, path: str | Path, *, to: str | None = None) -> None:
    """Write a mission in another program's format, by the file's suffix or by name; it is read back first.

    Raises
    ------
    InputError
        No such format, or it needs a georeference that the mission has not.
    NegativeResult
        The format cannot hold a property that the mission depends on.
    """
    from stopgo.mission.files.atomic import write_atomic
    from stopgo.mission.files.exports import exported, format_named
    from stopgo.mission.files.exports.format import Supplements

    write_atomic(Path(path), exported(mission, format_named(to, Path(path)), Supplements()))


def connect(endpoint: str, *, robot: str, **options: Any) -> AbstractContextManager[Station]:
    """Connect to a robot at `endpoint`, such as `tcp/127.0.0.1:7447`; returns a context manager.

    Options are those of `stopgo.bridge.station.station.connect`: site, commander, timeout_s, keys, insecure.

    Raises
    ------
    RobotUnreachable
        If the robot was not found in time; nothing was sent.
    """
    from stopgo.bridge.station.station import connect as connected

    return connected(endpoint, robot=robot, **options)


def push(mission: Mission, station: Station) -> None:
    """Send a mission to a robot and verify that it is stored; an interrupted push continues where it ended.

    Raises
    ------
    NegativeResult
        The robot rejects it, with its reason.
    OutcomeUnknown
        No answer came: the mission may or may not be stored.
    """
    station.push(mission)


def follow(station: Station) -> Iterator[Followed]:
    """Return states, poses and events of the robot's run as they come, until the run is over."""
    return station.reports()


def replay(
    log: str | Path,
    mission: Mission,
    *,
    align: Literal["first", "stops"] | None = None,
    to_map: tuple[float, float, float] | None = None,
    time_offset_s: float = 0.0,
) -> Replay:
    """Compare a robot's own log with the mission that it was to drive.

    Parameters
    ----------
    align
        `first`: the log begins at the mission's start; `stops`: it is fitted by its standstills.
    to_map
        x, y, heading (m, radians) of the site in the log's frame.

    Raises
    ------
    InputError
        When it cannot be read, has no transform to the mission frame, or is of another mission.
    Undecided
        When its standstills fit the stops by no placing, or by several.
    """
    from stopgo.mission.frames.transform import Transform
    from stopgo.recordings.logs import read_log
    from stopgo.recordings.replay.log_placing import Placing
    from stopgo.recordings.replay.replaying import replay as laid

    seen = None if to_map is None else Transform(x=to_map[0], y=to_map[1], heading=to_map[2])
    how = Placing(to_map=seen, align=align, time_offset_s=time_offset_s)
    return laid(read_log(Path(log)), mission, how)


def main() -> int:
    """The `stopgo` command."""
    try:
        return _run()
    except KeyboardInterrupt:  # while that is loaded which has a line for it
        print("stopgo: stopped by Ctrl-C", file=sys.stderr)  # noqa: T201
        return 130


def _run() -> int:
    trouble = _too_old() or _incomplete()
    if trouble:
        print(f"stopgo: {trouble}", file=sys.stderr)  # noqa: T201
        return 2
    from stopgo.late_methods import compile_when_called

    compile_when_called()
    from stopgo.command_line import main as run

    return run()


def rerun_importer() -> int:
    """The `rerun-importer-stopgo` command, which Rerun calls for every file that it opens."""
    sys.argv[1:1] = ["rerun-importer"]
    return main()


def _too_old() -> str:
    """The line for a Python that is too old; empty if it is not."""
    if sys.version_info >= (3, 11):  # noqa: UP036  a copied folder is not held to requires-python
        return ""
    return f"needs Python 3.11 or newer; this is {sys.version.split()[0]} ({sys.executable})"


def _incomplete() -> str:
    """The line that names a missing folder of ours; empty if all are there."""
    from importlib.util import find_spec

    missing = []
    for name in FOLDERS:
        spec = find_spec(f"stopgo.{name}")
        found = None if spec is None or spec.origin is None else Path(spec.origin).parent
        if found not in (_HERE / name, _HERE.parent / name):  # the second: a checkout without links
            missing.append(name)
    if not missing:
        return ""
    return (
        f"the installation in {_HERE} is incomplete: no {', '.join(missing)}; "
        "install it again (a checkout on Windows: `git config core.symlinks true`, then check out again)"
    )


__all__ = [
    "batch",
    "check",
    "connect",
    "export",
    "follow",
    "plan",
    "push",
    "read_floor",
    "read_mission",
    "replay",
    "settings",
    "write_mission",
]

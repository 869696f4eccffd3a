"""Work of the planning processes: read a floor, plan a variant with live progress, run a command on files.

A process takes one task after another from its connection, and answers with messages: progress, and last
the result or the one line of an error. A floor that ends the process ends nothing else.
"""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import signal
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stopgo.command_line import main
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.settings import PARAMETERS

if TYPE_CHECKING:
    from stopgo.site.stop_edits import EditablePlan

Tell = Callable[[dict[str, Any]], None]
WorkAnswer = dict[str, Any]
MOST_SHOWN = 3000
"""Candidates that are shown while a plan is made."""
DRAWING = "drawing.json"
MOST_KEPT_PLANS = 6
FLOOR_CHOICES = ("storey", "level", "drawing")
"""Options by which one floor of a file with several is chosen."""


@dataclass(frozen=True)
class ReadTask:
    """A floor to read, and options of its reader as people write them."""

    floor: Path
    options: dict[str, str]


@dataclass(frozen=True)
class VariantTask:
    """A plan to make into an empty folder."""

    floor: Path
    options: dict[str, str]
    out: Path
    required: tuple[tuple[float, float], ...] = ()
    """Positions that must be stops."""
    forbidden: tuple[tuple[float, float, float], ...] = ()
    """Circles without stops."""
    replaces: Path | None = None
    """Mission that the plan will replace: it gets the next revision."""


@dataclass(frozen=True)
class EditTask:
    """Stops changed by hand in a plan that the same process made into a folder."""

    out: Path
    kept: tuple[str, ...]
    """Stops of the plan that stay."""
    added: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class CommandTask:
    """A command of the command line on files of the folder."""

    arguments: list[str] = field(default_factory=list)


def work_on(connection: Connection) -> None:
    """Work on the tasks of a connection until it is closed; a process's own work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    kept = KeptPlans()
    works: dict[type[Any], Callable[[Any, Tell], WorkAnswer]] = {
        ReadTask: read_work, VariantTask: partial(variant_work, kept=kept), CommandTask: command_work,
        EditTask: kept.edit_work,
    }  # fmt: skip
    while True:
        try:
            task = connection.recv()
            connection.send({"done": _answer(partial(works[type(task)], task), connection)})
        except (EOFError, BrokenPipeError):
            return


def _answer(work: Callable[[Tell], WorkAnswer], connection: Connection) -> WorkAnswer:
    """Return the answer of a task; an error becomes its line."""
    log = io.StringIO()
    try:
        with contextlib.redirect_stderr(log), contextlib.redirect_stdout(io.StringIO()):
            return work(connection.send)
    except StopgoError as error:
        return {"error": str(error), "log": log.getvalue()}
    except OSError as error:
        return {"error": f"{error.filename or 'a file'}: {error.strerror or error}"}
    except Exception as error:  # noqa: BLE001  where the task of a process ends
        return {"error": f"unexpected error ({type(error).__name__}: {error}); please report it"}


def settings_of(options: dict[str, str], **more: Any) -> Any:
    """Return checked settings from options as people write them.

    Raises
    ------
    InputError
        Naming the option and its value.
    """
    by_key = {parameter.key: parameter for parameter in PARAMETERS.values()}
    values: dict[str, Any] = {}
    for key, text in options.items():
        if key not in by_key:
            raise InputError(f"{key[:60]}: no such option")
        if text.strip():
            parameter = by_key[key]
            plain: Any = (
                text.strip() if parameter.form else _plain(parameter.plain, text.strip(), parameter.flag)
            )
            values[parameter.name] = parameter.given(plain)
    return read_settings(None, {**values, **more})


def _plain(kind: type, text: str, flag: str) -> Any:
    if kind is bool:
        return text in ("yes", "true", "on", "1")
    try:
        return kind(text)
    except ValueError:
        raise InputError(f"{flag} {text[:60]}: must be a number") from None


def read_work(task: ReadTask, tell: Tell) -> WorkAnswer:
    """Read a floor: its drawing, its storeys, and what was odd."""
    from stopgo.planner.floors import options_of, read_floor, survey_floor
    from stopgo.site.page_drawing import floor_drawing_json, shapes_of

    options = options_of(settings_of(task.options))
    floors = [item for item in survey_floor(task.floor, options).floors if item.option]
    choices = [
        {"name": item.name, "area_m2": item.area_m2, "aside": item.aside, "options": _choosing(item.option)}
        for item in floors
    ]
    chosen = task.options
    if floors and not set(chosen) & set(FLOOR_CHOICES):
        usual = next((item for item in floors if not item.aside), floors[0])
        chosen = {**chosen, **_choosing(usual.option)}
    try:
        floor = read_floor(task.floor, options_of(settings_of(chosen)))
    except StopgoError as error:
        return {"storeys": choices, "chosen": chosen, "drawing": None, "trouble": str(error)}
    area = sum(part.area for part in floor.outline)
    about = {"rooms": len(floor.rooms), "openings": len(floor.openings), "area_m2": area}
    return {
        "storeys": choices,
        "chosen": chosen,
        "drawing": floor_drawing_json(shapes_of(floor), floor.findings),
        "about": about,
    }


def _choosing(option: str) -> dict[str, str]:
    """Return the option by which a floor of a file is chosen, such as `--level 3.2`, by its key."""
    flag, value = shlex.split(option)
    return {flag.removeprefix("--"): value}


class KeptPlans:
    """The last plans of a process, so that stops may be changed without planning again."""

    def __init__(self) -> None:
        self._plans: OrderedDict[Path, EditablePlan] = OrderedDict()

    def add(self, out: Path, results: dict[str, Any]) -> None:
        """Keep the plan of a folder, by the results of its stages."""
        from stopgo.mission.stages.sight import sight_of
        from stopgo.site.stop_edits import EditablePlan

        mission, route = results["Mission"], results["Route"]
        self._plans[out] = EditablePlan(mission, route, sight_of(route, mission, results["Figures"]))
        while len(self._plans) > MOST_KEPT_PLANS:
            self._plans.popitem(last=False)

    def edit_work(self, task: EditTask, tell: Tell) -> WorkAnswer:
        """Return what changed stops cost; raises `InputError` if the plan is not kept any more."""
        plan = self._plans.get(task.out)
        if plan is None:
            raise InputError("this plan is not kept any more; plan the variant again")
        return plan.cost(task.kept, task.added)


def variant_work(task: VariantTask, tell: Tell, kept: KeptPlans | None = None) -> WorkAnswer:
    """Plan a floor into the task's folder; progress is reported stage by stage."""
    from stopgo.plan_files import PrintOptions, plan_files

    more: dict[str, Any] = {}
    if task.required:
        more["use"] = task.required
    if task.forbidden:
        more["avoid"] = task.forbidden
    settings = settings_of(task.options, **more)
    if settings.divided:
        raise InputError("a variant is one mission; plan those that divide a floor with stopgo plan or batch")
    if task.replaces is not None:
        (task.out / "mission.json").write_bytes(task.replaces.read_bytes())
    progress = PlanProgress(tell, task.out)
    reports = plan_files(
        task.floor, task.out, settings, print_options=PrintOptions(sheets=True), observe=progress.observe
    )
    if kept is not None:
        kept.add(task.out, progress.results)
    return {"report": _summary(reports[0].as_json()) | {"twice": progress.twice}}


def _summary(report: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a plan that the page compares."""
    return {
        "mission": report["mission"], "stops": report["selection"]["stops"],
        "bound": report["selection"]["bound"], "coverage": report["selection"]["coverage"],
        "required": report["coverage"]["total"]["required"], "length_m": report["route"]["length_m"],
        "total_s": report["schedule"]["total_s"],
        "findings": [_finding(one) for one in report["floor"]["findings"]],
        "overlap": report.get("overlap"), "unreached": report["unreached"],
    }  # fmt: skip


def _finding(found: dict[str, Any]) -> dict[str, Any]:
    """Return a finding of a report as the page shows it."""
    about = {"code": found["code"], "text": found["message"], "rank": found["rank"].upper()}
    return about | {"at": found.get("at")}


class PlanProgress:
    """Progress of a plan as the page shows it: each stage's result as soon as it is there."""

    def __init__(self, tell: Tell, out: Path) -> None:
        self._tell = tell
        self._out = out
        self.results: dict[str, Any] = {}
        """Result of each stage, by its type's name."""
        self.twice: float | None = None
        """Fraction of all visible targets that two stops or more see."""

    def observe(self, result: object) -> None:
        """Take the result of a stage."""
        kind = type(result).__name__
        self.results[kind] = result
        shown = getattr(self, f"_{kind.lower()}", None)
        if shown is not None:
            self._tell({"stage": kind, **shown(result)})
        if kind == "Mission":
            self._write_drawing()

    def _floorplan(self, floor: Any) -> dict[str, Any]:
        from stopgo.site.page_drawing import floor_drawing_json, shapes_of

        return {"drawing": floor_drawing_json(shapes_of(floor), floor.findings)}

    def _candidates(self, found: Any) -> dict[str, Any]:
        step = max(1, len(found.xy) // MOST_SHOWN)
        return {"candidates": [[round(x, 2), round(y, 2)] for x, y in found.xy[::step].tolist()]}

    def _selection(self, selection: Any) -> dict[str, Any]:
        chosen = [[round(x, 2), round(y, 2)] for x, y in selection.xy.tolist()]
        return {"chosen": chosen, "coverage": selection.coverage}

    def _route(self, route: Any) -> dict[str, Any]:
        legs = [
            [[round(x, 2), round(y, 2)] for x, y in leg.tolist()] for leg in route.approaches if len(leg) > 1
        ]
        return {"legs": legs, "length_m": float(route.length)}

    def _write_drawing(self) -> None:
        from stopgo.mission.stages.sight import sight_of
        from stopgo.site.page_drawing import mission_drawing_json, shapes_of

        mission, route = self.results["Mission"], self.results["Route"]
        sight = sight_of(route, mission, self.results["Figures"])
        visible = sight.totals.amount(sight.totals.visible)
        twice = (sight.views_from(sight.ids) > 1) & sight.totals.visible
        self.twice = sight.totals.amount(twice) / visible if visible else None
        drawing = mission_drawing_json(mission, shapes_of(self.results["FloorPlan"]), sight)
        (self._out / DRAWING).write_text(json.dumps(drawing), encoding="utf-8")


def command_work(task: CommandTask, tell: Tell) -> WorkAnswer:
    """Run a command, and return its exit code and what it printed."""
    out, log = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(log):
        code = main(task.arguments)
    return {"code": code, "text": out.getvalue(), "log": log.getvalue()}

"""Plans of every storey of a model: each in its own folder, two at a time, with a summary table."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import typer

from stopgo.mission.console.process import ended_at_once, without_ctrl_c
from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import printable_lines, table
from stopgo.mission.errors import InputError
from stopgo.mission.settings import Settings
from stopgo.planner.floors import options_of, survey_floor
from stopgo.planner.floors.survey import FloorChoice

Planned = tuple[int, str, list[dict[str, Any]]]
"""Exit code, text for a person, and the JSON object of each part."""
PlanOne = Callable[[Path, Path, Settings], Planned]
AT_ONCE = 2


def plan_storeys(floor: Path, out: Path, settings: Settings, plan_one: PlanOne, *, as_json: bool) -> int:
    """Plan all storeys that people walk on; returns the worst exit code of the storeys.

    It is at least 1 if a floor with rooms or doors is left out.

    Raises
    ------
    InputError
        When the settings name a storey, or the file has none.
    """
    if settings.storey is not None or settings.level is not None:
        raise InputError("--all-storeys and a storey are both given; remove one of them")
    with running(f"reading {floor}"):
        found = survey_floor(floor, options_of(settings))
    storeys = [item for item in found.floors if not item.aside and item.option]
    if not storeys:
        raise InputError(f"{floor}: {_none_planned(found.floors)}")
    left_out = [item for item in found.floors if item.aside]
    names = [item.name for item in storeys]
    folders = [out / name for name in folder_names(names)]
    each = [replace(settings, storey=name) for name in names]
    pool = ProcessPoolExecutor(AT_ONCE, mp_context=get_context("spawn"))
    with running(f"planning {len(storeys)} storeys"), ended_at_once(pool):
        with without_ctrl_c():
            plans = pool.map(plan_one, [floor] * len(storeys), folders, each)
        planned = list(plans)
    _print_storeys(list(zip(storeys, folders, planned, strict=True)), left_out, as_json=as_json)
    return max(*(code for code, _, _ in planned), int(any(item.has_rooms for item in left_out)))


def _none_planned(floors: Sequence[FloorChoice]) -> str:
    """Return the reason why no storey is planned, and the remedy."""
    if not any(item.option for item in floors):
        return "contains no storeys; remove --all-storeys"
    reasons = "; ".join(f"{item.name}: {item.reason}" for item in floors)
    return f"has no storey that is planned without --storey ({reasons}); name one, such as {floors[0].option}"


def folder_names(storeys: Sequence[str]) -> list[str]:
    """Return a folder name for each storey: valid on every file system, and unique."""
    names: list[str] = []
    for number, storey in enumerate(storeys, 1):
        plain = re.sub(r"[^\w+-]+", "-", storey).strip("-")[:60] or f"storey-{number}"
        taken = {name.casefold() for name in names}
        names.append(plain if plain.casefold() not in taken else f"{plain}-{number}")
    return names


def _print_storeys(
    done: list[tuple[FloorChoice, Path, Planned]], left_out: Sequence[FloorChoice], *, as_json: bool
) -> None:
    if as_json:
        storeys = [
            {"storey": storey.name, "folder": str(folder), "exit_code": code, "parts": parts}
            | ({} if parts else {"error": text})
            for storey, folder, (code, text, parts) in done
        ]
        omitted = [
            {"storey": item.name, "area_m2": item.area_m2, "has_rooms": item.has_rooms, "why": item.reason}
            for item in left_out
        ]
        typer.echo(json.dumps({"storeys": storeys, "left_out": omitted}, ensure_ascii=False))
        return
    for _, _, (_, text, _) in done:
        typer.echo(printable_lines(text))
    typer.echo("")
    typer.echo(table(("storey", "stops", "route m", "coverage %", "folder"), list(_rows(done))))
    for item in left_out:
        area = "" if item.area_m2 is None else f" ({item.area_m2:.0f} m²)"
        typer.echo(printable_lines(f"left out: {item.name}{area}: {item.reason}; {item.option}"))


def _rows(done: list[tuple[FloorChoice, Path, Planned]]) -> Iterator[tuple[str, ...]]:
    for storey, folder, (_, text, parts) in done:
        if not parts:
            yield storey.name, "-", "-", "-", text
            continue
        stops = sum(part["selection"]["stops"] for part in parts)
        length = sum(part["route"]["length_m"] for part in parts)
        coverage = min(part["selection"]["coverage"] for part in parts)
        yield storey.name, str(stops), f"{length:.1f}", f"{100 * coverage:.1f}", str(folder)

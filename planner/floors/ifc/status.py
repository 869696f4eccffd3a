"""Construction status of a model on a day: from the tasks of its products, or from a separate schedule."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from msgspec.structs import replace

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model, Product, Task
from stopgo.planner.floors.ifc.solids import AT_SCANNER, KERB
from stopgo.planner.floors.legible_text import legible

Status = Literal["built", "in_progress", "not_started", "removed"]
THINGS = (*AT_SCANNER, "stairs", "railings", "doors")
"""Roles of what is built; spaces and openings are not."""
MOST_NAMED = 5
Tasks = Mapping[str, tuple[Task, ...]]


@dataclass(frozen=True)
class Statuses:
    """Products built on a day, by GlobalId, and products built before an earlier day."""

    day: str
    since: str | None
    on: Mapping[str, Status]
    standing: frozenset[str]
    """Built on `since` already: it hides what is behind it, and is not scanned again."""
    without_task: frozenset[str]
    unrelated: int = 0
    """Names in a schedule that names no product and no phase of the model."""


def statuses(model: Model, *, day: str, since: str | None, schedule: Tasks) -> Statuses:
    """The status of every product on a day.

    The schedule's tasks of a product count, else the model's, else the schedule's row of its phase.
    What has no task is built: most of what is modelled and not scheduled is there already.
    """
    of_phase = {name.casefold(): own for name, own in schedule.items()}
    tasks = {
        item.global_id: schedule.get(item.global_id) or item.tasks or _of_phases(item, of_phase)
        for item in model.described.products
    }
    if not any(tasks.values()) and not schedule:
        raise InputError(
            f"date {day}: no product of the model has a task or a day, and no schedule names one; "
            "give a CSV of this model with --schedule, or leave the date out"
        )
    on = {guid: status_on(day, own) for guid, own in tasks.items()}
    standing = {guid for guid, own in tasks.items() if since and status_on(since, own) == "built"}
    without = frozenset(guid for guid, own in tasks.items() if not own)
    phases = {name.casefold() for item in model.described.products for name in item.phases}
    related = any(name in tasks or name.casefold() in phases for name in schedule)
    unrelated = 0 if related else len(schedule)
    return Statuses(day, since, on, frozenset(standing), without, unrelated)


def _of_phases(product: Product, schedule: Tasks) -> tuple[Task, ...]:
    """The tasks that a schedule gives the phases that make and remove a product; names are casefolded."""
    made, removed = (schedule.get(name.casefold(), ()) if name else () for name in product.phases)
    return (*made, *(replace(task, removes=True) for task in removed))


def status_on(day: str, tasks: tuple[Task, ...]) -> Status:
    """Status of a product at the end of a day, from its tasks; days are YYYY-MM-DD.

    It is built once its last task is finished, and begun with its first; a removal ends it.
    """
    for task in (item for item in tasks if item.removes):
        if task.finish is not None and task.finish <= day:
            return "removed"
        if task.start is not None and task.start <= day:
            return "in_progress"
    building = [item for item in tasks if not item.removes]
    if all(item.finish is not None and item.finish <= day for item in building):
        return "built"
    begins = min(item.start or item.finish or day for item in building)
    return "in_progress" if begins <= day else "not_started"


def on_day(model: Model, found: Statuses, level: Level) -> tuple[Model, list[Finding], dict[str, int]]:
    """Return the model as built on a day, the findings on it, and the count of each class on a floor.

    A slab under construction does not carry the robot: only built ones are floor.

    Raises
    ------
    InputError
        When the slab of the floor is not there on that day.
    """
    items = [item for item in model.described.products if _is_on(item, model, level)]
    counts: Counter[str] = Counter(found.on[item.global_id] for item in items)
    kept = tuple(item for item in model.described.products if _stands(item, found))
    _check_floor(model, found, level)
    there = Model(replace(model.described, products=kept), model.vertices, model.faces)
    return there, list(_status_findings(found, counts, items)), _figures(found, counts, items)


def _figures(found: Statuses, counts: Counter[str], items: list[Product]) -> dict[str, int]:
    without = sum(item.global_id in found.without_task for item in items)
    standing = sum(item.global_id in found.standing for item in items)
    figures = {key: counts[key] for key in ("built", "in_progress", "not_started", "removed")}
    return {**figures, "without_task": without, **({"built_before": standing} if found.since else {})}


def _is_on(product: Product, model: Model, level: Level) -> bool:
    """True if a product is part of a floor's plan: a body above the floor, or the slab itself."""
    body = model.meshes.get(product.global_id)
    if body is None or product.role not in THINGS:
        return False
    if product.role in ("slabs", "coverings") and abs(body.z[1] - level.z) <= 0.05:
        return True
    reaches = body.z[1] > level.z + KERB and body.z[0] < level.ceiling - KERB
    return reaches and not (product.role in ("slabs", "roofs", "coverings") and body.z[0] > level.z + 1.8)


def _stands(product: Product, found: Statuses) -> bool:
    status = found.on[product.global_id]
    if product.role not in THINGS:
        return True
    return status == "built" or (
        status == "in_progress" and product.role not in ("slabs", "coverings", "doors")
    )


def _check_floor(model: Model, found: Statuses, level: Level) -> None:
    """Refuse a day on which nothing bears the robot."""
    slabs = [
        item
        for item in model.described.products
        if item.role == "slabs" and item.faces[1] and abs(model.meshes[item.global_id].z[1] - level.z) <= 0.05
    ]
    missing = [item for item in slabs if found.on[item.global_id] != "built"]
    if missing and len(missing) == len(slabs):
        first = missing[0]
        state = found.on[first.global_id].replace("_", " ")
        raise InputError(
            f"date {found.day}: no floor at '{level.name}' on that day: slab {first.global_id} "
            f"'{first.name}' is {state}; choose a later day or another storey"
        )


def _status_findings(found: Statuses, counts: Counter[str], products: list[Product]) -> list[Finding]:
    words = ", ".join(
        f"{counts[key]} {key.replace('_', ' ')}"
        for key in ("built", "in_progress", "not_started", "removed")
        if counts[key]
    )
    since = f"; {sum(item.global_id in found.standing for item in products)} were built by {found.since}"
    findings = [Finding("status", f"on {found.day}: {words}{since if found.since else ''}")]
    if found.unrelated:
        text = (
            f"none of the schedule's {found.unrelated} GlobalIds is in the model: is it another model's, "
            "or were its capitals changed?"
        )
        findings.append(Finding("schedule_unrelated", text))
    without = sorted(item.global_id for item in products if item.global_id in found.without_task)
    if without:
        more = f" and {len(without) - MOST_NAMED} more" if len(without) > MOST_NAMED else ""
        few = counted(len(without), "element has", "elements have")
        named = f"{', '.join(without[:MOST_NAMED])}{more}"
        findings.append(Finding("no_task", f"{few} no task, taken as built: {named}"))
    phased = sorted(
        {name for item in products if item.global_id in found.without_task for name in item.phases if name}
    )
    if phased:
        shown = ", ".join(f"'{legible(name)}'" for name in phased[:MOST_NAMED])
        text = f"phases without a day are not used: {shown}; give each a row of --schedule by its name"
        findings.append(Finding("phases_undated", text))
    return findings

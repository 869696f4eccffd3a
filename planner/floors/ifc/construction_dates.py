"""Construction dates of an IFC file's products: tasks of both schemas, days and phases in properties."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
from ifcopenshell.util.element import get_property_definition

from stopgo.planner.floors.ifc.model import Task

REMOVING = {"DEMOLITION", "DISMANTLE", "REMOVAL"}
DATES = re.compile(
    r"^(?P<what>.*?)(?P<end>start|begin|finish|end|complet\w*|install\w*|built|date|fertig\w*|einbau\w*)",
    re.IGNORECASE,
)
FINISH_NAMES = re.compile(
    r"(finish|end|complet|install|built|as.?built|fertig|einbau|gereed).*(date|datum|time)?$|"
    r"^(construction|installation|build).?date$",
    re.IGNORECASE,
)
START_NAMES = re.compile(r"(start|begin|anfang).*(date|datum|time)?$", re.IGNORECASE)
PHASE_NAMES = re.compile(
    r"^(phase|phase created|construction.?phase|bauphase|phase de construction)$", re.IGNORECASE
)
REMOVED_NAMES = re.compile(r"^(phase demolished|abbruchphase|phase de démolition)$", re.IGNORECASE)
NEVER = ("", "none", "keine", "aucun", "<none>")
"""Value of a product's demolition phase if no phase removes it."""
DAY = re.compile(r"^\d{4}-\d{2}-\d{2}")


def tasks_by_product(model: ifcopenshell.file) -> dict[int, tuple[Task, ...]]:
    """Tasks of each product by its number in the file; what is assembled of parts hands its tasks to them."""
    found: dict[int, list[Task]] = defaultdict(list)
    for entity, task in (*_of_tasks(model), *_of_properties(model)):
        for part in _with_parts(entity):
            found[part.id()].append(task)
    return {key: tuple(sorted(set(tasks), key=_order)) for key, tasks in found.items()}


def _with_parts(entity: Any) -> Iterator[Any]:
    """A product and what it is assembled of; a door in its opening is no part of the wall."""
    yield entity
    for part in ifcopenshell.util.element.get_parts(entity):
        yield from _with_parts(part)


def _order(task: Task) -> tuple:
    return (task.finish or "", task.start or "", task.name, task.source)


def _of_tasks(model: ifcopenshell.file) -> Iterator[tuple[Any, Task]]:
    for task in model.by_type("IfcTask"):
        dated = _dated_2x3(task) if model.schema == "IFC2X3" else _dated(task)
        if dated is None:
            continue
        for relation in getattr(task, "OperatesOn", None) or ():
            yield from ((item, dated) for item in relation.RelatedObjects if item.is_a("IfcProduct"))
        for relation in getattr(task, "HasAssignments", None) or ():
            product = getattr(relation, "RelatingProduct", None)
            if product is not None and product.is_a("IfcProduct"):
                yield product, dated


def _dated(task: Any) -> Task | None:
    """IfcTaskTime: what was done before what is planned."""
    time = task.TaskTime
    if time is None:
        return None
    start = _day(time.ActualStart) or _day(time.ScheduleStart) or _day(time.EarlyStart)
    finish = _day(time.ActualFinish) or _day(time.ScheduleFinish) or _day(time.EarlyFinish)
    if start is None and finish is None:
        return None
    removes = str(task.PredefinedType or "") in REMOVING
    return Task(task.Name or "", start, finish, removes, "IfcTaskTime")


def _dated_2x3(task: Any) -> Task | None:
    """IfcScheduleTimeControl through IfcRelAssignsTasks."""
    for relation in getattr(task, "HasAssignments", None) or ():
        if not relation.is_a("IfcRelAssignsTasks") or relation.TimeForTask is None:
            continue
        time = relation.TimeForTask
        start = _day(time.ActualStart) or _day(time.ScheduleStart)
        finish = _day(time.ActualFinish) or _day(time.ScheduleFinish)
        if start or finish:
            removes = bool(re.search(r"demoli|remov|dismantl", str(task.ObjectType or ""), re.IGNORECASE))
            return Task(task.Name or "", start, finish, removes, "IfcScheduleTimeControl")
    return None


def _of_properties(model: ifcopenshell.file) -> Iterator[tuple[Any, Task]]:
    """Products whose own properties hold a day of start or finish."""
    dated = _sets_with(model, (START_NAMES.search, FINISH_NAMES.search), holds=_day_in)
    for relation in model.by_type("IfcRelDefinesByProperties") if dated else ():
        properties = relation.RelatingPropertyDefinition
        if properties is None or properties.id() not in dated:
            continue
        start, finish, name = _days_in(properties)
        if start or finish:
            for item in relation.RelatedObjects or ():
                if item.is_a("IfcProduct"):
                    yield item, Task(name, start, finish, source=f"property {name}")


def _sets_with(
    model: ifcopenshell.file,
    patterns: tuple[Callable[[str], Any], ...],
    *,
    holds: Callable[[Any], Any] = bool,
) -> dict[int, Any]:
    """Property sets, by their numbers, with a property that holds something and is named by a pattern.

    Few properties of a model do. So the names of all are looked at, and then only these sets are read.
    """

    @cache
    def fits(name: str) -> bool:
        return any(pattern(name) for pattern in patterns)

    wanted = [item for item in model.by_type("IfcProperty") if fits(item[0] or "") and holds(item)]
    holders = (holder for item in wanted for holder in model.get_inverse(item))
    return {holder.id(): holder for holder in holders if holder.is_a("IfcPropertySet")}


def _days_in(properties: Any) -> tuple[str | None, str | None, str]:
    start = finish = None
    said_by = ""
    for item in properties.HasProperties or ():
        day = _day_in(item)
        if day is None:
            continue
        if START_NAMES.search(item.Name or ""):
            start = day
        elif FINISH_NAMES.search(item.Name or ""):
            finish = day
        else:
            continue
        said_by = f"{properties.Name}.{item.Name}"
    return start, finish, said_by


def _day_in(item: Any) -> str | None:
    """The day that a property holds, as YYYY-MM-DD."""
    if not item.is_a("IfcPropertySingleValue") or item.NominalValue is None:
        return None
    return _day(item.NominalValue.wrappedValue)


def phases_by_product(model: ifcopenshell.file) -> dict[int, tuple[str, str]]:
    """The phases that make and remove each product, as Revit's `Phase Created`, by its number in the file.

    A phase that is not named is empty; a product without any is not among them. Property sets of a product
    come after those of its type, whose values they replace.
    """
    phased = _sets_with(model, (PHASE_NAMES.match, REMOVED_NAMES.match))
    said = {key: get_property_definition(item) for key, item in phased.items()}
    of_product: dict[int, dict[str, dict[str, Any]]] = defaultdict(dict)
    for product, properties in (*_of_types(model, phased), *_of_objects(model, phased)):
        of_product[product].setdefault(properties.Name, {}).update(said[properties.id()])
    return {product: _phases_in(sets) for product, sets in of_product.items()}


def _of_types(model: ifcopenshell.file, phased: dict[int, Any]) -> Iterator[tuple[int, Any]]:
    """Products with the property sets of their types that are among some."""
    typed = set()
    for relation in model.by_type("IfcRelDefinesByType") if phased else ():
        sets = getattr(relation.RelatingType, "HasPropertySets", None) or ()
        own = [item for item in sets if item.id() in phased]
        for product in {item.id() for item in relation.RelatedObjects or ()}.difference(typed):
            typed.add(product)
            yield from ((product, item) for item in own)


def _of_objects(model: ifcopenshell.file, phased: dict[int, Any]) -> Iterator[tuple[int, Any]]:
    """Products with their own property sets that are among some."""
    for relation in model.by_type("IfcRelDefinesByProperties") if phased else ():
        definition = relation.RelatingPropertyDefinition
        several = definition is not None and definition.is_a("IfcPropertySetDefinitionSet")
        for item in definition.wrappedValue if several else (definition,):
            if item is not None and item.id() in phased:
                yield from ((product.id(), item) for product in relation.RelatedObjects or ())


def _phases_in(sets: dict[str, dict[str, Any]]) -> tuple[str, str]:
    """The phases that property sets name, by the names of the sets."""
    made = removed = ""
    for said in sets.values():
        for key, value in said.items():
            if not (isinstance(key, str) and isinstance(value, str)):
                continue
            if PHASE_NAMES.match(key):
                made = made or value.strip()
            elif REMOVED_NAMES.match(key) and value.strip().casefold() not in NEVER:
                removed = removed or value.strip()
    return made, removed


def _day(value: Any) -> str | None:
    """The day of an ISO date or of an IFC2x3 date, as YYYY-MM-DD."""
    if value is None:
        return None
    if isinstance(value, str):
        return value[:10] if DAY.match(value) else None
    date = getattr(value, "DateComponent", value)
    if not hasattr(date, "YearComponent"):
        return None
    return f"{date.YearComponent:04d}-{date.MonthComponent:02d}-{date.DayComponent:02d}"

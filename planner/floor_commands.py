"""`stopgo floors`: what is in a floor's file, told before anybody plans."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from planner.floors.survey import FloorChoice, LayerUse, Survey


def add_floor_commands(app: typer.Typer) -> None:
    """Add the verbs about floors' files."""
    app.command(name="floors", epilog="Example: stopgo floors building.dxf")(floors_command)


def floors_command(
    file: Annotated[Path, typer.Argument(help="The floor's file: a .dxf.")],
    layer: Annotated[
        list[str] | None,
        typer.Option(help="NAME=KIND of a layer, such as A-WALL=walls or DIM=ignore; repeatable."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """Tell what a file holds that a plan can be made of, what it was taken for, and what is odd about it."""
    from mission.settings import read_settings
    from mission.table import printable_lines
    from planner.floors import options_of, survey_floor

    settings = read_settings(None, {"layers": tuple(layer) if layer else None})
    found = survey_floor(file, options_of(settings))
    if as_json:
        typer.echo(json.dumps(found.as_json(), ensure_ascii=False))
    else:
        typer.echo(printable_lines("\n".join(survey_lines(found))))
    return 0


def survey_lines(found: Survey) -> list[str]:
    """What a person reads: the floors, the layers, what was worked out, left out, and is odd."""
    from planner.report import finding_lines

    units = f"; unit: {found.units}" if found.units else ""
    return [
        f"{found.file}: {found.kind}{units}",
        *(line for floor in found.floors for line in _floor_lines(floor)),
        *(_layer_line(layer) for layer in found.layers),
        *(f"  inferred    {text}" for text in found.inferred),
        *(f"  left out    {text}" for text in found.ignored),
        *finding_lines(found.findings),
    ]


def _floor_lines(floor: FloorChoice) -> list[str]:
    level = "" if floor.level_m is None else f" at {floor.level_m:+.2f} m"
    area = "" if floor.area_m2 is None else f", {floor.area_m2:.0f} m²"
    counts = ", ".join(f"{count} {kind}" for kind, count in floor.elements.items() if count)
    mark = "*" if floor.chosen else " "
    lines = [f"{mark} floor       {floor.name}{level}{area}{f': {counts}' if counts else ''}"]
    lines += [f"              {note}" for note in floor.notes]
    return [*lines, f"              {floor.option}"] if floor.option else lines


def _layer_line(layer: LayerUse) -> str:
    counts = ", ".join(
        f"{count} {word}" for count, word in ((layer.taken, "used"), (layer.ignored, "left out")) if count
    )
    return f"  layer       {layer.name} -> {layer.role} ({layer.why}): {counts}"

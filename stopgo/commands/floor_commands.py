"""`stopgo floors` reports the contents of a floor's file; `stopgo convert` writes it as a layered DXF."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import counted, printable_lines
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_not_replace, write_atomic
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.settings import FLOOR_PARAMETERS
from stopgo.planner.commands.options import values_of, with_options

if TYPE_CHECKING:
    from stopgo.mission.floor import FloorPlan
    from stopgo.planner.floors.reader import FloorOptions
    from stopgo.planner.floors.survey import FloorChoice, LayerUse, Survey


def add_commands(app: typer.Typer) -> None:
    """Add `convert` and `floors` to the app."""

    floors = with_options(floors_command, (*FLOOR_PARAMETERS, "layers"))
    convert = with_options(convert_command, (*FLOOR_PARAMETERS, "layers"))
    app.command(name="convert", epilog="Example: stopgo convert building.ifc --storey EG -o eg.dxf")(convert)
    app.command(name="floors", epilog="Example: stopgo floors building.ifc --picture floors.svg")(floors)


def floors_command(
    file: Annotated[Path, typer.Argument(help="The floor's file: a .dxf, .ifc, .ifczip or map.yaml.")],
    *,
    picture: Annotated[
        Path | None, typer.Option(help="SVG to draw: the elements read, and the lines left out.")
    ] = None,
    write_map: Annotated[
        Path | None, typer.Option(help="Write the meaning assigned to each layer, for correction.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    **given: Any,
) -> int:
    """Report the floors in a file, the meaning assigned to its layers, and its anomalies.

    Exit code 1: the file gives no floor as it is; the last line states the reason and the remedy.
    """
    from stopgo.planner.floors import options_of, survey_floor
    from stopgo.planner.floors.layer_map import layer_map

    for out in (picture, write_map):
        must_not_replace(out, file)
    options = options_of(read_settings(None, values_of(given)))
    with running(f"reading {file}"):
        found = survey_floor(file, options)
    if picture is not None:
        _draw(picture, file, found, options)
    if write_map is not None:
        write_atomic(write_map, layer_map(found).encode("utf-8"))
    if as_json:
        typer.echo(json.dumps(found.as_json(), ensure_ascii=False))
    else:
        typer.echo(printable_lines("\n".join(survey_lines(found))))
    return 0 if found.refusal is None else 1


def convert_command(
    file: Annotated[Path, typer.Argument(help="The floor's file: a .dxf, an .ifc or an .ifczip.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The .dxf to write, or a .yaml: a map of Nav2.")],
    *,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    **given: Any,
) -> int:
    """Write a floor as a layered DXF in metres; it gives the same stops, and can be edited first.

    A .yaml is a map of Nav2 with its picture, and a mask for its keep-out filter (.keepout.yaml).
    """
    from stopgo.planner.floors import options_of, read_floor

    if out.suffix.lower() not in (".dxf", ".yaml"):
        raise InputError(f"{out}: does not end in .dxf or .yaml; give a name with one of them")
    must_not_replace(out, file)
    options = options_of(read_settings(None, values_of(given)))
    with running(f"reading {file}"):
        floor = read_floor(file, options)
    lost = _write_map(out, file, floor) if out.suffix.lower() == ".yaml" else _write_drawing(out, floor)
    for text in lost:
        typer.echo(f"stopgo: {text}", err=True)
    if as_json:
        result = {"file": str(out), "floor": floor.name, "rooms": len(floor.rooms), "lost": lost}
        typer.echo(json.dumps(result, ensure_ascii=False))
    else:
        typer.echo(f"{out}: {floor.name}, {floor.area:.0f} m², {len(floor.rooms)} rooms")
    return 0


def _write_drawing(out: Path, floor: FloorPlan) -> list[str]:
    """Write a layered DXF; return what it cannot hold."""
    from stopgo.mission.files.layered_dxf import layered_dxf

    write_atomic(out, layered_dxf(floor))
    return list(_lost_in_drawing(floor))


def _write_map(out: Path, file: Path, floor: FloorPlan) -> list[str]:
    """Write a map of Nav2 and its mask, each with its picture; return what they cannot hold."""
    from stopgo.mission.files.nav2_map import nav2_map

    made = nav2_map(floor)
    for yaml, picture in ((out, made.map), (out.with_suffix(".keepout.yaml"), made.mask)):
        image = yaml.with_suffix(".pgm")
        for path in (yaml, image):
            must_not_replace(path, file)
        write_atomic(image, picture)
        write_atomic(yaml, made.yaml(image.name))
    return ["a map shows what was drawn, not what stands there; localise the robot on it before a run"]


def _lost_in_drawing(floor: FloorPlan) -> Iterator[str]:
    """Data of the floor that a layered drawing cannot store, in words."""
    earth = floor.georeference
    if earth is not None:
        origin = f"{earth.lat:.7f},{earth.lon:.7f},{earth.alt:.2f},{earth.heading_deg:.3f}"
        yield f"a drawing stores no georeference; plan it with --origin {origin}"
    settled = sum(not item.to_scan for item in floor.elements)
    if settled:
        few = counted(settled, "element is", "elements are")
        yield f"{few} not to be scanned on that date; the drawing marks all as to be scanned"


def _draw(out: Path, file: Path, found: Survey, options: FloorOptions) -> None:
    """Draw the floor that the options choose; else every floor of the file that can be planned."""

    from stopgo.mission.files.floor_svg import floor_svg
    from stopgo.planner.floors import read_floor

    if found.lines:
        taken, ignored = (
            [line.drawn for line in found.lines if line.taken == wanted] for wanted in (True, False)
        )
        write_atomic(out, floor_svg([found.floor] if found.floor else [], taken=taken, ignored=ignored))
        return
    names = [item.name for item in found.floors if not item.aside]
    if any(item.chosen for item in found.floors) or not names:
        floors = [read_floor(file, options)]
    else:
        floors = [read_floor(file, replace(options, storey=name)) for name in names]
    write_atomic(out, floor_svg(floors))


def survey_lines(found: Survey) -> list[str]:
    """Return the lines for a person: floors, layers, inferred elements, elements left out, and findings."""
    from stopgo.planner.commands.plan_report import finding_lines

    units = f"; unit: {found.units}" if found.units else ""
    return [
        f"{found.file}: {found.kind}{units}",
        *(line for floor in found.floors for line in _floor_lines(floor)),
        *(_layer_line(layer) for layer in found.layers),
        *(f"  inferred    {text}" for text in found.inferred),
        *(f"  left out    {text}" for text in found.ignored),
        *finding_lines(found.findings),
        *([f"  no floor    {found.refusal}"] if found.refusal else []),
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

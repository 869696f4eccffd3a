"""`stopgo plan`: plan a floor's file and write mission, recording, picture and coverage to a folder."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.mission.console.notice import notice
from stopgo.mission.console.table import printable_lines
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.files.plan_toml import read_settings, settings_json, settings_toml
from stopgo.mission.settings.parameter import FIRST
from stopgo.plan_files import PrintOptions, plan_files
from stopgo.planner.commands.options import values_of, with_options
from stopgo.result_files import result_folder

if TYPE_CHECKING:
    from stopgo.mission.settings import Settings
    from stopgo.planner.commands.plan_report import PlanReport

EXAMPLE = "Example: stopgo plan floor.dxf -o plan --range 8 --start 2.5,3.0,90"

FloorArgument = Annotated[
    Path | None,
    typer.Argument(
        help="The floor: a .dxf, layered or as drawn; an .ifc or .ifczip; a map.yaml.", show_default=False
    ),
]
PlanFolderOption = Annotated[
    Path, typer.Option("-o", "--out", rich_help_panel=FIRST, help="Folder for the results.")
]
ParametersOption = Annotated[
    Path | None,
    typer.Option("-p", "--parameters", rich_help_panel=FIRST, help="plan.toml; options override it."),
]
AllPartsOption = Annotated[
    bool, typer.Option(rich_help_panel="Floor", help="Also plan parts not connected with the first.")
]
AllStoreysOption = Annotated[
    bool,
    typer.Option(
        rich_help_panel="Floor",
        help="Plan every storey of a model that people walk on, each into its folder.",
    ),
]
PlanStrictOption = Annotated[
    bool, typer.Option(rich_help_panel="Output", help="Exit 1 if floor is left out or the plan is doubtful.")
]
SheetsOption = Annotated[
    bool | None,
    typer.Option(
        "--sheets/--no-sheets",
        rich_help_panel="Output",
        help="plan.pdf: sheets and lists to print; by default where 1:100 needs several sheets.",
    ),
]
RingsOption = Annotated[
    bool, typer.Option(rich_help_panel="Output", help="Draw the scanner's range round each stop.")
]
PrintConfigOption = Annotated[
    bool, typer.Option(rich_help_panel="Output", help="Print plan.toml with these options and leave.")
]


def add_commands(app: typer.Typer) -> None:
    """Add `plan` to the app."""

    app.command(name="plan", epilog=EXAMPLE)(with_options(plan_command))


def plan_command(
    floor: FloorArgument = None,
    out: PlanFolderOption = Path(),
    parameters: ParametersOption = None,
    *,
    all_parts: AllPartsOption = False,
    all_storeys: AllStoreysOption = False,
    strict: PlanStrictOption = False,
    sheets: SheetsOption = None,
    rings: RingsOption = False,
    print_config: PrintConfigOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", rich_help_panel=FIRST, help="One JSON object on stdout.")
    ] = False,
    **given: Any,
) -> int:
    """Plan where the scanner must stand on a floor, and the route that visits those stops.

    Exit code 1: no plan can be made, the robot would drive over lines that were not read, or --accuracy is
    not met; with --strict also where floor is left out or the plan is doubtful.
    """

    settings = read_settings(parameters, values_of(given), notify=notice)
    if print_config:
        _print_config(settings, as_json=as_json)
        return 0
    if floor is None:
        raise InputError("no floor given; name a file, such as: stopgo plan floor.dxf -o plan")
    options = PrintOptions(sheets, rings)
    if all_storeys:
        from stopgo.planner.commands.storeys import plan_storeys

        plan_one = partial(_plan_storey, all_parts=all_parts, strict=strict, print_options=options)
        return plan_storeys(floor, result_folder(out), settings, plan_one, as_json=as_json)
    reports = plan_files(floor, out, settings, all_parts=all_parts, print_options=options, beside=True)
    _print_reports(reports, as_json=as_json)
    return _exit_code(reports, strict=strict)


def _print_config(settings: Settings, *, as_json: bool) -> None:

    typer.echo(json.dumps(settings_json(settings)) if as_json else settings_toml(settings))


def _plan_storey(
    floor: Path,
    folder: Path,
    settings: Settings,
    *,
    all_parts: bool,
    strict: bool,
    print_options: PrintOptions,
) -> tuple[int, str, list[dict[str, Any]]]:
    """Plan one storey, in any process: exit code, text for a person, and the objects for `--json`."""
    try:
        reports = plan_files(floor, folder, settings, all_parts=all_parts, print_options=print_options)
    except StopgoError as error:
        return error.exit_code, str(error), []
    text = "\n".join(report.as_text() for report in reports)
    return _exit_code(reports, strict=strict), text, [report.as_json() for report in reports]


def _exit_code(reports: list[PlanReport], *, strict: bool) -> int:
    """The worst exit code of the parts."""
    return max(report.strict_exit_code if strict else report.exit_code for report in reports)


def _print_reports(reports: list[PlanReport], *, as_json: bool) -> None:
    if not as_json:
        typer.echo(printable_lines("\n".join(report.as_text() for report in reports)))
        return
    result = reports[0].as_json()
    if len(reports) > 1:
        result["parts"] = [report.as_json() for report in reports[1:]]
    typer.echo(json.dumps(result, ensure_ascii=False))

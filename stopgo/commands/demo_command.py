"""`stopgo demo`: plan a sample office, and record the run of a simulated robot that drives the plan."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.mission.errors import OutcomeUnknown
from stopgo.plan_files import plan_files

if TYPE_CHECKING:
    from stopgo.bridge.station.station import Station
    from stopgo.mission.comparing.comparison import Comparison
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.planner.commands.plan_report import PlanReport

EXAMPLE = "Example: stopgo demo -o recordings/demo"


def add_commands(app: typer.Typer) -> None:
    """Add `demo` to the app."""
    app.command(name="demo", epilog=EXAMPLE)(demo_command)


def demo_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(
        "recordings/demo"
    ),
    speed_up: Annotated[
        float, typer.Option(min=0.01, max=1000, help="The simulated robot's time goes this much faster.")
    ] = 60.0,
) -> int:
    """Plan a sample office, send the mission to a simulated robot in its own process, and follow its run."""
    import tempfile
    from importlib.resources import as_file, files

    from stopgo.bridge.commands.spawn import robot_process
    from stopgo.bridge.station.station import connect
    from stopgo.mission.files.plan_toml import read_settings

    with as_file(files("stopgo.recordings") / "samples" / "office.dxf") as floor:
        report = plan_files(floor, out, read_settings(None, {}), beside=True)[0]
    typer.echo(report.as_text())
    with (
        tempfile.TemporaryDirectory() as state,
        robot_process("demo", Path(state), speed_up=speed_up) as endpoint,
    ):
        typer.echo(f"\nrobot demo listens on {endpoint}; simulated {speed_up:g} times faster than real time")
        with connect(endpoint, robot="demo") as station:
            station.push(report.mission)
            typer.echo(f"pushed mission {report.mission.id}, read back from the robot")
            station.command("start")
            collected, final_state = _follow(station, report, out / "field.rrd")
    comparison = collected.compared()
    if comparison is None:
        raise OutcomeUnknown("demo: the run ended without a report; start the demo again")
    return _print_outcome(comparison, final_state, out)


def _follow(station: Station, report: PlanReport, path: Path) -> tuple[RunCollector, str]:
    """Record the run to its end; returns the collected data and the state it ended in."""
    from stopgo.bridge.station.watch import watch_run
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.mission.stages.sight import sight_of
    from stopgo.recordings.embedded.reading import read_recording
    from stopgo.recordings.runs.field import FieldRecording

    plan = read_recording(report.files["recording"])
    with FieldRecording(
        path, report.mission, plan=plan, say=lambda line: typer.echo(line, err=True)
    ) as record:
        collected = RunCollector(record, [sight_of(report.part.route, report.mission, report.figures)])
        collected.mission(report.mission)
        last = watch_run(station, collected, say=lambda line: typer.echo(f"  {line}", err=True))
    return collected, last.state


def _print_outcome(comparison: Comparison, final_state: str, out: Path) -> int:
    """Print the comparison of run and plan; returns the exit code."""
    from stopgo.mission.comparing.comparison_text import comparison_text
    from stopgo.mission.comparing.run_verdict import judge

    typer.echo(f"\n{comparison_text(comparison)}\n")
    typer.echo(f"run {comparison.run_id} {final_state}")
    typer.echo(f"look at both: stopgo review {out / 'plan.rrd'} {out / 'field.rrd'} --view")
    return judge(comparison).exit_code

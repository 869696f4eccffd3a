"""`stopgo review`: reads recordings to their end, compares runs with their plan, and writes reports."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import printable, printable_lines
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_not_replace, write_atomic

if TYPE_CHECKING:
    from stopgo.recordings.page.reviewed import RecordingReview, Review

EXAMPLE = "Example: stopgo review plan.rrd field.rrd --html report.html"


def add_commands(app: typer.Typer) -> None:
    """Add the command to `stopgo`."""
    app.command(epilog=EXAMPLE)(review)


def review(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING.rrd...", help="Plan or field recordings, or folders.")
    ],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Exit 1 where one is incomplete or contradicts its mission.")
    ] = False,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="REPORT.html", help="Write a report as one HTML file.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="MERGED.rrd", help="Write them as one recording.")
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option("--png", metavar="DIR", help="Write a picture of every view, without a screen."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open them together in the Rerun viewer.")] = False,
) -> int:
    """Read recordings to their end, and report the plan and what the runs acquired.

    Given together, a run is compared with its plan: its acquired coverage is computed again. Exit code 1: the
    run acquired less than the plan requires; 3: the result is unknown; 2: a file cannot be read.
    """
    from stopgo.recordings.page.reviewed import review as read

    must_not_replace(html, *recordings)
    with running("reading recordings") as step:
        found = read(recordings)
        if found.recordings:
            step.begin("writing the results")
            _write_files(found, html, out, png)
    _print_review(found, as_json=json_)
    if view:
        from stopgo.recordings.viewing.viewer import open_viewer

        with _shown_together(found.recordings) as paths:
            open_viewer(paths)
    return found.check_code if check else found.exit_code


def _write_files(found: Review, html: Path | None, out: Path | None, png: Path | None) -> None:
    """Write the report, the merged recording and the pictures, each if the user gave its path."""
    if html is not None:
        from stopgo.recordings.page import report_html
        from stopgo.recordings.page.from_recordings import subject_of

        write_atomic(html, report_html(subject_of(found)))
    if out is not None:
        from stopgo.recordings.catalog.merging import merge

        merge([item.recording for item in found.recordings], out)
    if png is not None:
        from stopgo.recordings.viewing.headless import write_pictures

        with _shown_together(_of_one_mission(found, png)) as paths:
            write_pictures(paths, png)


@contextmanager
def _shown_together(recordings: Sequence[RecordingReview]) -> Iterator[list[Path]]:
    """Yield the files to open: plan and runs of one mission as one recording, for a viewer joins no files."""
    paths = [item.recording.path for item in recordings]
    if len(paths) < 2 or len({item.recording.mission_id for item in recordings}) > 1:
        yield paths
        return
    from stopgo.recordings.catalog.merging import merge

    with TemporaryDirectory() as folder:
        merged = Path(folder) / "together.rrd"
        merge([item.recording for item in recordings], merged)
        yield [merged]


def _of_one_mission(found: Review, folder: Path) -> tuple[RecordingReview, ...]:
    """Return the recordings, if all are of one mission: views show only one."""
    ids = sorted({item.recording.mission_id for item in found.recordings})
    if len(ids) > 1:
        raise InputError(
            f"--png {folder}: these recordings are of {len(ids)} missions: {', '.join(ids)}; "
            "name the recordings of one mission"
        )
    return found.recordings


def _print_review(found: Review, *, as_json: bool) -> None:
    """Print the review on stdout, and files that cannot be read on stderr."""

    if as_json:
        items = [item.as_json() for item in found.recordings]
        alone = len(items) == 1 and not found.faults
        both = [item.as_json() for item in found.together.values()]
        whole = items[0] if alone else {"recordings": items, "together": both, "faults": list(found.faults)}
        typer.echo(json.dumps(whole, ensure_ascii=False))
    else:
        typer.echo(printable_lines(found.as_text()))
    for fault in found.faults:
        typer.echo(f"stopgo: {printable(fault)}", err=True)

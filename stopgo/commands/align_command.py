"""`stopgo align`: the transform from the site to a robot's map, from points that are known in both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.mission.console.table import table
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.atomic import write_checked
from stopgo.mission.files.given_file import bytes_of, rows_of
from stopgo.mission.settings.parameter import numbers

if TYPE_CHECKING:
    from stopgo.mission.frames.rigid_fit import RigidFit
    from stopgo.mission.geometry import FloatArray

FORM = "write X,Y=MAPX,MAPY in metres, such as 2.5,3=12.1,-4.7"
FARTHEST = 1e7
REMEDY = "are they in the same order, and each noted where the robot stood? Remove what is wrong"


def align(
    pairs: Annotated[
        Path | None,
        typer.Argument(metavar="PAIRS.csv", help="Lines of x,y,map_x,map_y in metres.", show_default=False),
    ] = None,
    pair: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y=MAPX,MAPY", help="A point of the site and on the map; repeatable."),
    ] = None,
    mission: Annotated[
        Path | None, typer.Option(help="With -o: the mission whose frame.to_map to set.")
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="File to write that mission to.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Fit the rotation and shift from the site to a robot's map, and print the residual of each point.

    Drive the robot onto points of the drawing, such as crosses on the floor, and note its pose there. Two
    points are needed; with more, their residuals show which was noted wrongly. The result is the value for
    `robot --map`.

    Exit code 1: the points do not fit one another, by more than maps drift.

    Example: stopgo align --pair 0,0=12.10,-4.70 --pair 8,0=20.06,-3.91 --pair 8,6=19.47,2.06
    """
    from stopgo.mission.frames.rigid_fit import rigid_fit

    if (mission is None) != (out is None):
        raise InputError("give --mission FILE and -o FILE together: the mission, and the file to write")
    points = [*(_read(pairs) if pairs else ()), *map(_pair, pair or ())]
    if not points:
        raise InputError(f"no points given; name a CSV file, or use --pair: {FORM}")
    site, there = _arrays(points)
    fit = rigid_fit(site, there)
    written = (
        None if out is None or mission is None or fit.is_doubtful else _with_transform(mission, out, fit)
    )
    _print_fit(fit, points, written, as_json=as_json)
    if fit.is_doubtful:
        raise NegativeResult(f"the points fit within {fit.rms_m:.2f} m only (root mean square); {REMEDY}")


PointPair = tuple[float, float, float, float]


def _print_fit(fit: RigidFit, points: Sequence[PointPair], written: str | None, *, as_json: bool) -> None:
    from stopgo.mission.files.mission_text import json_text

    typer.echo(json_text(_report(fit, points, written)) if as_json else _text(fit, points, written))


def _pair(text: str) -> PointPair:
    try:
        x, y, map_x, map_y = (*numbers(text.partition("=")[0]), *numbers(text.partition("=")[2]))
    except ValueError:
        raise InputError(f"--pair {text}: {FORM}") from None
    return _finite((x, y, map_x, map_y), f"--pair {text}")


def _read(path: Path) -> list[PointPair]:
    remedy = "give a CSV of x,y,map_x,map_y"
    try:
        text = bytes_of(path, remedy).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not a text file; {remedy}") from None
    lines = rows_of(text, str(path))
    return [_row(row, f"{path}: line {number}") for number, row in lines if not _is_header(number, row)]


def _is_header(number: int, row: Sequence[str]) -> bool:
    return number == 1 and [cell.strip().lower() for cell in row] == ["x", "y", "map_x", "map_y"]


def _row(row: Sequence[str], where: str) -> PointPair:
    try:
        x, y, map_x, map_y = map(float, row)
    except ValueError:
        raise InputError(f"{where} is '{','.join(row)}': write four numbers, x,y,map_x,map_y") from None
    return _finite((x, y, map_x, map_y), where)


def _finite(pair: PointPair, where: str) -> PointPair:
    if not all(math.isfinite(number) and abs(number) < FARTHEST for number in pair):
        raise InputError(f"{where}: must be finite numbers below {FARTHEST:g}")
    return pair


def _arrays(points: Sequence[PointPair]) -> tuple[FloatArray, FloatArray]:
    import numpy as np

    array = np.array(points)
    return array[:, :2], array[:, 2:]


def _with_transform(mission: Path, out: Path, fit: RigidFit) -> str:
    """Write the mission with the transform in its frame; return its revision in words."""
    from msgspec.structs import replace

    from stopgo.mission.document import with_digest
    from stopgo.mission.files.mission_json import encode, next_revision, read

    document = read(mission)
    placed = replace(document, frame=replace(document.frame, to_map=fit.transform))
    # A robot that holds the one would refuse the other as the same revision.
    later = document.revision + (placed != document)
    made = with_digest(replace(placed, revision=max(later, next_revision(out, placed))))
    write_checked(out, encode(made))
    return f"{out}: {made.name}, revision {made.revision}"


def map_option(fit: RigidFit) -> str:
    """Return the value for `robot --map`: micrometres, and degrees as fine as that at 100 m."""
    at = fit.transform
    return f"{at.x:.6f},{at.y:.6f},{math.degrees(at.heading):.6f}"


def _report(fit: RigidFit, points: Sequence[PointPair], written: str | None) -> dict[str, Any]:
    return {
        "map": None if fit.is_doubtful else map_option(fit),
        "to_map": fit.transform,
        "rms_m": fit.rms_m,
        "max_m": fit.max_m,
        "scale": fit.scale,
        "pairs": [
            {"xy": pair[:2], "map_xy": pair[2:], "residual_m": float(off)}
            for pair, off in zip(points, fit.residuals, strict=True)
        ],
        "mission": written,
    }


def _text(fit: RigidFit, points: Sequence[PointPair], written: str | None) -> str:

    header = ("x m", "y m", "map x m", "map y m", "residual mm")
    rows = [
        (*(f"{number:.3f}" for number in pair), f"{1000 * off:.0f}")
        for pair, off in zip(points, fit.residuals, strict=True)
    ]
    few = f"; {fit.unshown}" if fit.unshown else ""
    result = () if fit.is_doubtful else (f"--map {map_option(fit)}",)
    lines = [
        table(header, rows), "",
        f"residuals {1000 * fit.rms_m:.0f} mm (root mean square), {1000 * fit.max_m:.0f} mm at most{few}",
        *result, *([] if written is None else [written]),
    ]  # fmt: skip
    return "\n".join(lines)

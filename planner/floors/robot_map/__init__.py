"""Reader of robots' maps: a ROS map.yaml with its picture becomes a floor in the map's own frame.

Occupied cells become walls, or obstacles where they are too small for one; unknown cells are not floor.
The coordinates are those of the map, so that stops are where the robot takes them to be.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.geometry import frozen
from stopgo.planner.floors.lines_and_texts import Stroke
from stopgo.planner.floors.linework import completed
from stopgo.planner.floors.parts import in_order, parts_of
from stopgo.planner.floors.reader import FloorFile, FloorOptions
from stopgo.planner.floors.robot_map.cell_regions import placed, polygons_of_cells, smoothed
from stopgo.planner.floors.robot_map.description import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    MapDescription,
    read_description,
)
from stopgo.planner.floors.robot_map.grey_picture import read_picture
from stopgo.planner.floors.survey import Survey, choice_of

LEAST_WALL = 0.5
"""A connected group of occupied cells smaller than this, in metres, is an obstacle and not a wall."""
LEAST_FLOOR = 1.0
"""A connected group of free cells smaller than this, in m², is not floor."""
MOST_SPECKS = 5000
"""Such groups that are obstacles: the maps of large halls have some hundreds."""
MOST_STEPS = 500_000
"""Edges between cells that are set and others: 25 km of outlines in cells of 5 cm."""
_NOISE = "that is noise, no map; filter it, or check image, negate, mode and the thresholds"
_EIGHT = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True, eq=False)
class _Grid:
    """A map's cells, sorted."""

    walls: NDArray[np.bool_]
    specks: NDArray[np.bool_]
    """Small obstacles."""
    floor: NDArray[np.bool_]
    """Free cells and the obstacles on them."""
    findings: tuple[Finding, ...]


def read(file: FloorFile, options: FloorOptions) -> FloorPlan:
    """Read the floor that a robot's map shows.

    Raises
    ------
    InputError
        When the description or its picture cannot be read, or no floor is free on it.
    """
    description, picture = _opened(file)
    grid = _grid(description, picture, file.path)
    strokes = [
        *_strokes(grid.floor, "floor", description),
        *_strokes(grid.walls, "walls", description),
        *_strokes(grid.specks, "other", description),
    ]
    made = completed(strokes, [])
    parts = parts_of(made.strokes, [], source=file.path, layers=(), known=frozenset({"map"}))
    return FloorPlan(
        name=file.path.stem,
        source=file.source(options={"image": hashlib.sha256(picture).hexdigest()}),
        outline=parts.outline,
        rooms=parts.rooms,
        openings=parts.openings,
        elements=parts.elements,
        findings=in_order((*grid.findings, *made.findings, *parts.findings)),
        on_robots_map=True,
    )


def survey(file: FloorFile, options: FloorOptions) -> Survey:
    """Return the survey of a robot's map."""
    description, picture = _opened(file)
    floor = read(file, options)
    cells = description.cells(read_picture(picture, name=description.image))
    unknown = int(np.count_nonzero(cells == UNKNOWN))
    return Survey(
        file=file.path.name,
        kind=f"robot map, {cells.shape[1]} x {cells.shape[0]} cells of {description.resolution:g} m",
        digest=file.digest,
        units="metre, in the map's own frame",
        floors=(choice_of(floor),),
        inferred=tuple(item.message for item in floor.findings if item.code.startswith("inferred_")),
        ignored=(f"{unknown} unknown cells ({unknown / cells.size:.0%}) are not floor",),
        findings=tuple(item for item in floor.findings if not item.code.startswith("inferred_")),
    )


def _opened(file: FloorFile) -> tuple[MapDescription, bytes]:
    """Return the description, and the bytes of its picture in the same folder."""
    description = read_description(file.data, name=str(file.path))
    path = file.path.parent / description.image
    try:
        return description, whole_file(path)
    except (OSError, ValueError):
        raise InputError(
            f"{file.path}: its image {description.image} cannot be read; put it in the same folder, "
            "or write where it is"
        ) from None


def _grid(description: MapDescription, picture: bytes, path: Path) -> _Grid:
    cells = description.cells(read_picture(picture, name=description.image))
    floor = _largest_floors(cells, description, path)
    occupied = (cells == OCCUPIED) & floor
    specks = _small(occupied, LEAST_WALL / description.resolution)
    findings = []
    _check_noise(floor, "free", path)
    _check_noise(occupied, "occupied", path)
    if specks.any():
        _, count = ndimage.label(specks, _EIGHT)
        if count > MOST_SPECKS:
            raise InputError(
                f"{path}: {count} groups of occupied cells smaller than {LEAST_WALL:g} m, more than "
                f"{MOST_SPECKS}: {_NOISE}"
            )
        text = f"{count} groups of occupied cells smaller than {LEAST_WALL:g} m are obstacles, no walls"
        findings.append(Finding("small_obstacles", text))
    return _Grid(occupied & ~specks, specks, floor, tuple(findings))


def _check_noise(mask: NDArray[np.bool_], what: str, path: Path) -> None:
    """Refuse cells with more outlines than any map has, before these are drawn."""
    steps = np.count_nonzero(mask[1:] != mask[:-1]) + np.count_nonzero(mask[:, 1:] != mask[:, :-1])
    if steps > MOST_STEPS:
        raise InputError(
            f"{path}: the outlines of its {what} cells have {steps} edges, more than {MOST_STEPS}: {_NOISE}"
        )


def _largest_floors(cells: NDArray[np.uint8], description: MapDescription, path: Path) -> NDArray[np.bool_]:
    """Connected free cells, with single unknown cells among them, and the adjacent occupied cells."""
    free = cells == FREE
    others = ndimage.convolve((~free).astype(np.uint8), _EIGHT.astype(np.uint8), mode="constant", cval=1)
    lone = (cells == UNKNOWN) & (others == 1)
    label, count = ndimage.label(free | lone)
    area = np.bincount(label[free], minlength=count + 1) * description.resolution**2
    large = area >= LEAST_FLOOR
    large[0] = False
    kept = large[label]
    if not kept.any():
        unknown = np.count_nonzero(cells == UNKNOWN) / cells.size
        raise InputError(
            f"{path}: no floor is free on the map ({unknown:.0%} of its cells are unknown); "
            "check image, negate, mode and the thresholds"
        )
    standing, count = ndimage.label((cells == OCCUPIED) | kept, _EIGHT)
    adjacent = np.zeros(count + 1, dtype=bool)
    adjacent[standing[kept]] = True
    return kept | (adjacent[standing] & (cells == OCCUPIED))


def _small(occupied: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Cells of groups that are smaller than `least` cells both ways."""
    label, _ = ndimage.label(occupied, _EIGHT)
    small = [
        number
        for number, (rows, columns) in enumerate(ndimage.find_objects(label), start=1)
        if max(rows.stop - rows.start, columns.stop - columns.start) < least
    ]
    return np.isin(label, small)


def _strokes(mask: NDArray[np.bool_], role: str, description: MapDescription) -> list[Stroke]:
    """Outlines of cells as closed strokes; holes have the opposite direction."""
    shapes = shapely.orient_polygons(smoothed(polygons_of_cells(mask)))
    return [
        Stroke(_ring(ring, description), "map", role, closed=True, fill=role != "floor")
        for shape in shapes
        for ring in (shape.exterior, *shape.interiors)
    ]


def _ring(ring: shapely.LinearRing, description: MapDescription) -> np.ndarray:
    corners = shapely.get_coordinates(ring)[:-1]
    return frozen(placed(corners, resolution=description.resolution, origin=description.origin))

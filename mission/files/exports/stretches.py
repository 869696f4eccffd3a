"""Stretches of boundary from coverage.json: those that the mission's stops see, and the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import FAR
from stopgo.mission.errors import InputError
from stopgo.mission.files.coverage_json import CoverageSegment, read_coverage
from stopgo.mission.geometry import FloatArray, frozen

Fraction = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Stretches:
    """Straight segments of the targets' boundary (n, 2, 2) in the site's metres."""

    seen: FloatArray
    unseen: FloatArray
    seen_of: tuple[str, ...] = ()
    """GlobalId of the element of each segment of `seen`, or an empty text; empty without a model."""
    unseen_of: tuple[str, ...] = ()


def read_stretches(path: Path, mission: Mission) -> Stretches:
    """Return the stretches in the coverage.json of `mission`.

    Raises
    ------
    InputError
        When the file cannot be read, or has the coverage of another mission.
    """
    coverage = read_coverage(path, mission)
    segments = [
        (segment, element.global_id or "") for element in coverage.elements for segment in element.segments
    ]
    _check_segments([segment for segment, _ in segments], path)
    seen = [(piece, of) for segment, of in segments for piece in _pieces(segment, segment.seen)]
    unseen = [(piece, of) for segment, of in segments for piece in _pieces(segment, _between(segment.seen))]
    boundary, rest = (frozen([piece for piece, _ in pieces]).reshape(-1, 2, 2) for pieces in (seen, unseen))
    return Stretches(boundary, rest, tuple(of for _, of in seen), tuple(of for _, of in unseen))


def _check_segments(segments: Sequence[CoverageSegment], path: Path) -> None:
    for segment in segments:
        near = all(abs(value) <= FAR for value in (*segment.a, *segment.b))
        if not near or not all(0 <= first <= last <= 1 for first, last in segment.seen):
            raise InputError(
                f"{path}: a segment from {segment.a} to {segment.b} is invalid; give the file that was "
                "written with the mission"
            )


def _between(seen: tuple[Fraction, ...]) -> Iterator[Fraction]:
    """Yield the parts of 0 to 1 outside the fractions, which are in order."""
    begin = 0.0
    for first, last in seen:
        if first > begin:
            yield begin, first
        begin = max(begin, last)
    if begin < 1.0:
        yield begin, 1.0


def _pieces(
    segment: CoverageSegment, fractions: Iterator[Fraction] | tuple[Fraction, ...]
) -> Iterator[FloatArray]:
    a, b = np.array(segment.a), np.array(segment.b)
    for first, last in fractions:
        yield np.stack([a + first * (b - a), a + last * (b - a)])

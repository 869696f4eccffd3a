"""Length of a drawing's unit: as given, or by evidence weighed; if that is not enough, the user is asked."""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized
from pathlib import Path

import numpy as np
from ezdxf.document import Drawing

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawn_shapes import Shape
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.units.unit_evidence import UnitEvidence, evidence_in, extent_of
from stopgo.planner.floors.units.unit_lengths import CODES, METRES, SHORT
from stopgo.planner.floors.units.unit_probability import measured, probabilities

BELIEVED = 0.95
"""A unit less probable than this is not used: the user is asked."""
_UNMEASURED = 0.98
"""The same for a unit that the header does not name, if no measure is for it rather than for the next one.

Such a drawing may be in no unit at all, as one that was made from a PDF.
"""
_DISPUTED = 0.995
"""The same for one where the measures are for another unit."""
_RATHER = 2.0
"""Measures are for a unit rather than for another if they are this many times as likely in it."""
_CONTRADICTS = 5.0
"""One measure contradicts a unit if it is this many times as likely in another."""
_POSSIBLE = (1.0, 2000.0)
"""Least and greatest length in metres of what a given unit may make."""
_USUAL = (3.0, 400.0)
"""A floor whose longer side is outside of these, in metres, is doubted."""
_DOOR = (0.4, 4.0)


class UnitAsked(InputError):
    """No unit of a drawing is probable enough; `choices` are the options to give, each with what it makes."""

    def __init__(self, message: str, choices: Sequence[tuple[str, str]]) -> None:
        super().__init__(message)
        self.choices = tuple(choices)


def unit_of(
    drawing: Drawing, shapes: Sequence[Shape], given: str | None, *, outlined: bool, source: Path
) -> tuple[float, list[Finding]]:
    """Metres per drawing unit, and findings where the header does not say so.

    Raises
    ------
    InputError
        When the given unit makes no building, or no unit is probable enough.
    """
    if given is not None:
        extent = extent_of(shapes, "floor" if outlined else "walls")
        return given_unit(given, extent, source=source)
    evidence = evidence_in(drawing, shapes, outlined=outlined)
    header = _header_code(drawing)
    ranked = sorted(probabilities(evidence, header=header).items(), key=lambda item: (-item[1], item[0]))
    if ranked[0][1] < _needed(ranked, header, evidence) and max(evidence.size) > 0:
        choices = _choices(ranked, evidence)
        raise UnitAsked(f"{source}: {_question(choices, header)}", choices)
    code = header if header in METRES and not max(evidence.size) else ranked[0][0]
    return METRES[code][1], _findings(code, header, ranked[0][1], evidence)


def _needed(ranked: Sequence[tuple[int, float]], header: int, evidence: UnitEvidence) -> float:
    """The probability that the first unit of a ranking needs."""
    measures = [measured(evidence, METRES[code][1]) for code, _ in ranked]
    # Distances between lines that are no walls are too often taken for the thickness to contradict others.
    own, *others = (without_thickness for _, *without_thickness in measures)
    if max(map(math.prod, others)) >= _RATHER * math.prod(own):
        return _DISPUTED
    is_contradicted = any(max(fits) >= _CONTRADICTS * mine for mine, *fits in zip(own, *others, strict=True))
    is_measured = math.prod(measures[0]) >= _RATHER * math.prod(measures[1])
    return BELIEVED if ranked[0][0] == header or (is_measured and not is_contradicted) else _UNMEASURED


def given_unit(name: str, extent: FloatArray, *, source: Path) -> tuple[float, list[Finding]]:
    """Return the length in metres of a unit given by name, such as `mm`.

    Raises
    ------
    InputError
        When there is no such unit, or the drawing would not have the size of a building.
    """
    code = CODES.get(name.strip().lower())
    if code is None:
        raise InputError(f"{source}: --units {legible(name)}: no such unit; known: {', '.join(CODES)}")
    word, factor = METRES[code]
    size = float(np.ptp(extent, axis=0).max()) * factor if len(extent) else None
    if size is not None and not _POSSIBLE[0] <= size <= _POSSIBLE[1]:
        raise InputError(
            f"{source}: --units {legible(name)} makes the drawing {size:.4g} m across; name another unit, "
            "or leave it out and stopgo looks at doors and walls"
        )
    return factor, [Finding("units_as_told", f"one unit is a {word}, as given")]


def _header_code(drawing: Drawing) -> int:
    value = drawing.header.get("$INSUNITS", 0)
    return int(value) if isinstance(value, int | float) and math.isfinite(value) else 0


def _choices(ranked: Sequence[tuple[int, float]], evidence: UnitEvidence) -> list[tuple[str, str]]:
    """The options for the two most probable units, each with the size it makes."""
    return [
        (
            f"--units {SHORT.get(code, METRES[code][0])}",
            f"({_size_text(evidence, code)}, {share:.0%} probable)",
        )
        for code, share in ranked[:2]
    ]


def _question(choices: Sequence[tuple[str, str]], header: int) -> str:
    says = f"the header says {METRES[header][0]}" if header in METRES else "the header names no unit"
    return f"the unit is not certain ({says}); give {' or '.join(map(' '.join, choices))}"


def _size_text(evidence: UnitEvidence, code: int) -> str:
    factor = METRES[code][1]
    return " x ".join(f"{side * factor:.3g}" for side in evidence.size) + " m"


def _findings(code: int, header: int, share: float, evidence: UnitEvidence) -> list[Finding]:
    name, factor = METRES[code]
    across = max(evidence.size) * factor
    if code == header:
        if _USUAL[0] <= across <= _USUAL[1] or _has_doors(evidence, factor):
            return []
        message = f"the floor is {across:.4g} m across, read in {name} (as the header says); check the unit"
        return [Finding("units_doubtful", message)]
    seen = _seen(evidence, factor)
    read = f"read in {name} ({share:.1%} probable by {seen}), which makes the floor {across:.4g} m across"
    if header not in METRES:
        return [Finding("units_missing", f"$INSUNITS = {header} names no unit of length; {read}")]
    wrong, other = METRES[header]
    makes = f"the header says {wrong}, which makes the floor {max(evidence.size) * other:.4g} m across"
    return [Finding("units_wrong", f"{makes}; {read}")]


def _has_doors(evidence: UnitEvidence, factor: float) -> bool:
    widths = evidence.leaves or evidence.across
    return bool(widths) and _DOOR[0] <= float(np.median(widths)) * factor <= _DOOR[1]


def _seen(evidence: UnitEvidence, factor: float) -> str:
    """The evidence that was weighed, in words."""
    kinds: tuple[tuple[Sized, str], ...] = (
        (evidence.dimensions, "dimensions"),
        (evidence.areas, "areas in rooms"),
        (evidence.sides, "rooms with written sides"),
        (evidence.furniture, "pieces of furniture"),
    )
    words = [f"{len(items)} {kind}" for items, kind in kinds if items]
    for widths, kind in ((evidence.leaves, "leaves"), (evidence.across, "doors")):
        if widths:
            words.append(f"{len(widths)} {kind} of {float(np.median(widths)) * factor:.2g} m")
    lengths = (
        (evidence.thickness, "walls {:.2g} m thick"),
        (evidence.going, "treads {:.2g} m apart"),
        (evidence.text_height, "texts {:.2g} m high"),
        (evidence.names_apart, "names of rooms {:.2g} m apart"),
    )
    words += [text.format(length * factor) for length, text in lengths if length]
    return ", ".join([*words, "its size"])


__all__ = ["BELIEVED", "UnitAsked", "given_unit", "unit_of"]

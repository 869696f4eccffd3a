"""Probability of each unit by the evidence in a drawing: Bayes' rule over the units that are possible.

Each kind of evidence gives a likelihood. Its least value stands for evidence that was misread, such as a
niche taken for a door, so that no single piece outweighs all others. Pieces of one kind count as one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from stopgo.planner.floors.units.room_texts import RoomSides
from stopgo.planner.floors.units.unit_evidence import Dimension, UnitEvidence
from stopgo.planner.floors.units.unit_lengths import METRES, USUAL
from stopgo.planner.floors.written_measures import LENGTHS

_HEADER_IS_RIGHT = 0.93
_SIZE = (20.0, 1.0)
"""Typical value in metres and its standard deviation in natural logarithms: the longer side of a floor, …"""
_SMALL = (20.0, 0.85)
"""… the same for a smaller one: there are fewer houses of 2 m than halls of 200 m; …"""
_LEAF = (0.9, 0.2)
_ACROSS = (0.95, 0.3)
_THICKNESS = (0.18, 0.5)
_TEXT = (0.2, 0.8)
_DIMENSION = (3.0, 1.3)
_NAMES = (3.5, 0.5)
"""Kitchen, bath and bedrooms are this far apart, from name to name."""
_FURNITURE = (1.0, 0.25)
_GOING = (0.28, 0.12)
_MISREAD = {
    "leaves": 0.04,
    "across": 0.03,
    "thickness": 0.08,
    "text": 0.2,
    "names": 0.05,
    "furniture": 0.05,
    "going": 0.1,
    "bare": 0.02,
    "said": 0.001,
}
"""Least likelihoods: one misread measure in that many."""
_MATCH = 0.03
"""Shown and measured lengths of one unit agree within this fraction."""
_AREA_MATCH = 0.12
"""Areas in texts are rounded, and measured to other faces of the walls."""
_AREA_MISREAD = 0.005
_SIDE_MATCH = 0.06
"""Both sides agree within this fraction: they may be measured to the middle of the walls."""


def probabilities(evidence: UnitEvidence, *, header: int) -> dict[int, float]:
    """Probability of each possible unit by $INSUNITS code; `header` is the code the header names."""
    prior = _prior(header)
    weighed = {code: share * _likelihood(evidence, METRES[code][1]) for code, share in prior.items()}
    total = sum(weighed.values())
    return {code: value / total for code, value in weighed.items()} if total > 0 else prior


def _prior(header: int) -> dict[int, float]:
    if header not in METRES:
        return dict(USUAL)
    rest = {code: share for code, share in USUAL.items() if not _alike(code, header)}
    total = sum(rest.values())
    others = {code: (1 - _HEADER_IS_RIGHT) * share / total for code, share in rest.items()}
    return {header: _HEADER_IS_RIGHT, **others}


def _alike(code: int, other: int) -> bool:
    """True for units that differ by less than a building shows, such as foot and US survey foot."""
    return abs(METRES[code][1] / METRES[other][1] - 1) < 1e-3


def _likelihood(evidence: UnitEvidence, factor: float) -> float:
    return math.prod(
        [
            _size(evidence, factor),
            _measures(_one(evidence.text_height), factor, _TEXT, "text"),
            _measures(_one(evidence.names_apart), factor, _NAMES, "names"),
            *measured(evidence, factor),
        ]
    )


def measured(evidence: UnitEvidence, factor: float) -> tuple[float, ...]:
    """Likelihood by the thickness of walls, each other measure of things, and texts on lengths and areas."""
    return (
        _measures(_one(evidence.thickness), factor, _THICKNESS, "thickness"),
        _measures(evidence.leaves, factor, _LEAF, "leaves"),
        _measures(evidence.across, factor, _ACROSS, "across"),
        _dimensions(evidence.dimensions, factor),
        _rooms(evidence, factor),
        _measures(evidence.furniture, factor, _FURNITURE, "furniture"),
        _measures(_one(evidence.going), factor, _GOING, "going"),
    )


def _one(value: float | None) -> tuple[float, ...]:
    return () if value is None else (value,)


def _bell(value: float, typical: tuple[float, float]) -> float:
    """Likelihood of a length in metres, 1 at the typical one."""
    return math.exp(-0.5 * (math.log(value / typical[0]) / typical[1]) ** 2)


def _size(evidence: UnitEvidence, factor: float) -> float:
    longer = evidence.bulk * factor
    typical = _SIZE if longer > _SIZE[0] else _SMALL
    return max(_bell(longer, typical), 1e-12) if longer > 0 else 1.0


def _measures(lengths: Sequence[float], factor: float, typical: tuple[float, float], kind: str) -> float:
    """Likelihood of a kind's median; many measures are misread together less often than one."""
    if not lengths:
        return 1.0
    least = max(_MISREAD[kind] / len(lengths) ** 1.5, 0.002)
    return max(_bell(float(np.median(lengths)) * factor, typical), least)


def _dimensions(dimensions: Sequence[Dimension], factor: float) -> float:
    """Likelihood of the lengths that dimensions show against those they measure."""
    said = [item for item in dimensions if item.unit is not None]
    if said:
        right = _share(LENGTHS[item.unit or ""] * item.shown / (item.measured * factor) for item in said)
        return max(right, _MISREAD["said"])
    if not dimensions:
        return 1.0
    lengths = [LENGTHS[name] for name in _bare_units(dimensions)]
    shares = _bare_units(dimensions).values()
    total = 0.0
    for length, share in zip(lengths, shares, strict=True):
        right = _share(length * item.shown / (item.measured * factor) for item in dimensions)
        typical = _bell(float(np.median([item.shown for item in dimensions])) * length, _DIMENSION)
        total += share * right * typical
    return max(total, _MISREAD["bare"])


def _share(ratios: Iterable[float]) -> float:
    """Fraction of ratios that are 1."""
    found = [abs(ratio - 1) <= _MATCH for ratio in ratios]
    return sum(found) / len(found)


def _bare_units(dimensions: Sequence[Dimension]) -> Mapping[str, float]:
    """Units that numbers without a unit may be in, by their size and decimals as offices write them."""
    shown = float(np.median([item.shown for item in dimensions]))
    if max(item.decimals for item in dimensions) >= 2 and shown < 100:
        return {"m": 0.85, "ft": 0.07, "in": 0.04, "cm": 0.04}
    if shown >= 600:
        return {"mm": 0.85, "cm": 0.12, "in": 0.03}
    if shown >= 60:
        return {"cm": 0.5, "in": 0.3, "mm": 0.2}
    return {"m": 0.4, "ft": 0.3, "in": 0.3}


def _rooms(evidence: UnitEvidence, factor: float) -> float:
    """Likelihood of what texts say of rooms; areas and sides come from the same texts and count as one."""
    likelihoods = []
    if evidence.areas:
        likelihoods.append(_areas(evidence.areas, factor))
    if evidence.sides:
        likelihoods.append(_sides(evidence.sides, factor))
    return max(likelihoods, default=1.0)


def _areas(areas: Sequence[tuple[float, float]], factor: float) -> float:
    """Likelihood of areas written in rooms; areas that fit no unit say nothing."""
    fits = [abs(written / (drawn * factor**2) - 1) <= _AREA_MATCH for written, drawn in areas]
    return max(sum(fits) / len(fits), _AREA_MISREAD)


def _sides(sides: Sequence[RoomSides], factor: float) -> float:
    """Likelihood of sides written in rooms; sides that fit no unit say nothing."""
    fits = [
        all(
            abs(said / (drawn * factor) - 1) <= _SIDE_MATCH
            for said, drawn in zip(item.written, item.drawn, strict=True)
        )
        for item in sides
    ]
    return max(sum(fits) / len(fits), _AREA_MISREAD)

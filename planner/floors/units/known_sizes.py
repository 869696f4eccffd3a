"""Things of known size in a drawing, which show its unit: furniture by a block's name, and stairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from ezdxf import bbox
from ezdxf.document import Drawing
from ezdxf.entities import Insert
from ezdxf.layouts import BlockLayout

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawing import BROKEN_INPUT
from stopgo.planner.floors.layer_names import any_of, plain_name

_THINGS = (
    (2.0, "BED BEDS BETT BETTEN CAMA CAMAS LETTO LETTI BEDDEN LOZKO LUZKO ŁÓŻKO"),
    (1.7, "BATHTUB* TUB BADEWANNE* WANNE BAIGNOIRE* BANERA* VASCA WANNA"),
    (0.9, "SHOWER* DUSCHE* DUCHA* DOCCIA PRYSZNIC* RECEVEUR"),
    (0.65, "WC TOILET TOILETS INODORO* KIBEL* SEDES* KLOSETT* CLOSESTOOL BIDET*"),
    (0.6, "WASHER* WASHING+MACHINE WASCHMASCHINE* PRALKA LAVADORA* LAVATRICE* LAVE+LINGE DISHWASHER*"),
    (0.6, "STOVE* COOKER* HOB HERD KUCHENKA"),
    (0.55, "WASHBASIN* BASIN* WASCHBECKEN* WASCHTISCH* LAVABO* UMYWALKA LAVANDINO*"),
    (0.5, "CHAIR CHAIRS STUHL STUEHLE CHAISE CHAISES SILLA SILLAS SEDIA SEDIE KRZESLO KRZESŁO"),
)
"""Usual length in metres of the longer side, and names of blocks that show such a thing from above."""
_MOST_PARTS = 2000
"""Blocks with more entities, or with blocks in them, show more than one thing."""
_LEAST_TREADS = 5
_EVEN = 0.03
"""Treads are apart by the same distance up to this fraction …"""
_MOST_ARE_EVEN = 0.6
"""… if at least this fraction of a stair's lines are treads."""


def furniture_in(drawing: Drawing) -> list[float]:
    """Drawing units per metre by each insert of a block that is named after a thing of known size."""
    found: list[float] = []
    sizes: dict[str, tuple[float, float, float] | None] = {}
    for insert in drawing.modelspace():
        if not isinstance(insert, Insert):
            continue
        name = str(insert.dxf.name)
        if name not in sizes:
            sizes[name] = _size_of(name, drawing.blocks.get(name))
        size = sizes[name]
        if size is not None:
            metres, width, depth = size
            longer = max(width * abs(insert.dxf.xscale), depth * abs(insert.dxf.yscale))
            if np.isfinite(longer) and longer > 0:
                found.append(float(longer) / metres)
    return found


def _size_of(name: str, block: BlockLayout | None) -> tuple[float, float, float] | None:
    """Usual length in metres, and width and depth as drawn, of a block that shows a thing of known size."""
    plain = plain_name(name)
    metres = next((metres for metres, words in _THINGS if any_of(words).search(plain)), None)
    if metres is None or block is None or not 0 < len(block) <= _MOST_PARTS:
        return None
    kinds = {item.dxftype() for item in block}
    if "INSERT" in kinds:
        return None
    drawn = [item for item in block if item.dxftype() not in ("ATTDEF", "TEXT", "MTEXT", "POINT")]
    try:
        box = bbox.extents(drawn, fast=True)
    except BROKEN_INPUT:
        return None
    return (metres, float(box.size.x), float(box.size.y)) if box.has_data else None


def going_of(lines: Sequence[FloatArray]) -> float | None:
    """Return the distance between the treads of stairs; None where most lines are not evenly apart.

    Parameters
    ----------
    lines
        Polylines (n, 2) on layers of stairs, in drawing units.
    """
    apart = np.array(sorted(_apart(lines)))
    if len(apart) < _LEAST_TREADS:
        return None
    going = float(np.median(apart))
    even = np.abs(apart / going - 1) <= _EVEN
    return going if np.count_nonzero(even) >= max(_LEAST_TREADS, _MOST_ARE_EVEN * len(apart)) else None


def _apart(lines: Sequence[FloatArray]) -> Iterator[float]:
    """Distances from each straight line to the next one that is parallel to it and as long."""
    treads = np.array([line for line in lines if len(line) == 2]).reshape(-1, 2, 2)
    along = treads[:, 1] - treads[:, 0]
    length = np.hypot(*along.T)
    treads, along, length = treads[length > 0], along[length > 0], length[length > 0]
    middle = treads.mean(axis=1)
    for k in range(min(len(treads), _MOST_PARTS)):
        way = along[k] / length[k]
        across = np.abs((middle - middle[k]) @ np.array([-way[1], way[0]]))
        aside = np.abs((middle - middle[k]) @ way)
        alike = np.abs(along @ np.array([-way[1], way[0]])) <= _EVEN * length
        alike &= (np.abs(length / length[k] - 1) <= _EVEN) & (aside <= _EVEN * length[k])
        alike &= across > 1e-3 * length[k]
        if alike.any():
            yield float(across[alike].min())

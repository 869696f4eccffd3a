"""The place of a room's label is the best of all, whichever of them are tried."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.files.room_labels import (
    AROUND,
    LABEL,
    OUTSIDE,
    STOPS,
    WALLS,
    WAY,
    Busy,
    KnownLabels,
    LabelPlaces,
    inside,
    room_labels,
)
from stopgo.mission.files.sheet import PaperBox, PaperSheet
from stopgo.mission.floor import Room
from stopgo.mission.geometry import FloatArray, Polygon

ROOM = np.array([[0, 0], [1, 0], [1, 1], [0.6, 1], [0.5, 0.7], [0, 1]])


@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 10, 400]), st.integers(0, 3), st.booleans())
def test_the_place_of_a_label_is_the_best_of_all(seed: int, points: int, labels: int, only_way: bool) -> None:
    random = np.random.default_rng(seed)
    high, half = random.uniform(4, 20, 2), random.uniform(0.5, 8, 2)
    weight = random.choice([WAY] if only_way else [WAY, WALLS, STOPS], points).astype(float)
    xy = random.uniform(0.3, 0.7, (points, 2)) * high if only_way else random.uniform(-2, 22, (points, 2))
    busy, written = Busy(xy, weight), random.uniform(-4, 24, (2, 28, labels))
    written.sort(axis=1)
    places = LabelPlaces([high * ROOM], np.zeros(2), high, busy, written)
    tried = np.array([(x, y) for y in np.linspace(0, high[1], 28) for x in np.linspace(0, high[0], 28)])
    crossed, way = _costs(tried, half, places)
    far = np.round(np.hypot(*((tried - high / 2) / (high + 1e-9)).T), 6)
    best, found = np.lexsort((far, crossed + way))[0], places.best(half)
    if crossed[best] > 0:
        assert found is None
    else:
        assert found is not None and found[0] == way[best] and np.allclose(found[1], tried[best])


def _costs(tried: FloatArray, half: FloatArray, places: LabelPlaces) -> tuple[FloatArray, FloatArray]:
    """Of what a label may not cross at each place, and of the route."""
    labels = places.written.transpose(2, 1, 0).reshape(-1, 2)
    xy, busy = np.concatenate([places.avoid.xy, labels]), places.avoid.weight
    weight = np.concatenate([busy, np.full(len(labels), LABEL)])
    near = ((xy > -half) & (xy < places.high + half)).all(axis=1)
    under = (np.abs(tried[:, None] - xy) < half + AROUND).all(axis=2) & near
    x, y = (np.unique(of)[:, None] + by * np.arange(-1, 2) for of, by in zip(tried.T, half, strict=True))
    within = inside(x.ravel(), y.ravel(), places.rings).reshape(len(y), 3, len(x), 3)
    outside = 9 - within.sum(axis=(1, 3)).ravel()
    return under @ (weight * (weight != WAY)) + OUTSIDE * outside, under @ (weight * (weight == WAY))


@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.booleans())
def test_known_labels_give_way_as_if_all_were_placed_again(seed: int, points: int, all_shown: bool) -> None:
    random = np.random.default_rng(seed)
    nowhere = PaperBox(0.0, 0.0, 0.0, 0.0)
    sheet = PaperSheet("", 0.0, 0.0, 100, nowhere, nowhere, nowhere, (), (0.0, 0.0))
    low = np.stack(np.meshgrid(*[np.arange(4) * 1.5] * 2), axis=-1).reshape(-1, 2)
    sizes = random.choice([1.5, 2.4, 5.0], (len(low), 2))
    rooms = [
        Room(f"R{k}", f"{k} Meeting and conference", (Polygon.of(at + (ROOM * size).round(3)),))
        for k, (at, size) in enumerate(zip(low, sizes, strict=True))
    ]
    walls = Busy.of((WALLS, [random.uniform(0, 120, (60, 2)) * (1, -1)]))
    marks = random.uniform(0, 120, (points, 2)) * (1, -1)
    avoid = Busy.of((STOPS, [marks[::2]]), (WAY, [marks[1::2]]), below=walls)
    shown = rooms if all_shown else [room for room in rooms if random.random() < 0.5]
    known = KnownLabels.of(rooms, sheet, walls)
    assert room_labels(shown, sheet, avoid=avoid, known=known) == room_labels(shown, sheet, avoid=avoid)

"""Difference between a picture of a view and a small reference picture that a person has checked.

`python -m tests.recordings.pictures` makes new reference pictures; look at them before they are committed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

KEPT = Path(__file__).parent / "kept_pictures"
SIZE = (48, 30)
"""Width and height of what is compared: averages over this many fields, so that fonts, drivers and the
exact place of a pixel do not matter."""
LIMIT = 0.35
"""A difference above this is another picture."""
COLOURLESS = 300.0
"""A sum of colours below this is that of texts and grids."""

Fields = np.ndarray
"""Averaged colours (30, 48, 3)."""


def fields(picture: Path) -> Fields:
    """A picture's averages."""
    with Image.open(picture) as image:
        return np.asarray(image.convert("RGB").resize(SIZE, Image.Resampling.BOX), dtype=float)


def kept(name: str) -> Path:
    return KEPT / f"{name}.png"


def difference(found: Fields, expected: Fields) -> float:
    """Return the difference as a fraction of all that contrasts with the expected picture's background.

    If the expected picture has colours and they differ more, return the difference of the colours.
    """
    background = np.median(expected.reshape(-1, 3), axis=0)
    whole = np.abs(found - expected).sum() / np.abs(expected - background).sum()
    off, colours = np.abs(_colours(found) - _colours(expected)).sum(), np.abs(_colours(expected)).sum()
    return float(max(whole, off / colours if colours > COLOURLESS else 0.0))


def _colours(picture: Fields) -> Fields:
    """Return the colours of a picture, without grey and without the tint of the background."""
    tint = picture - picture.mean(axis=2, keepdims=True)
    return tint - np.median(tint.reshape(-1, 3), axis=0)


def emptied(found: Fields) -> Fields:
    return np.broadcast_to(np.median(found.reshape(-1, 3), axis=0), found.shape)


def upside_down(found: Fields) -> Fields:
    return found[::-1]


def recoloured(found: Fields) -> Fields:
    """Red for green, green for blue, blue for red."""
    return np.roll(found, 1, axis=2)


WRONG: dict[str, Callable[[Fields], Fields]] = {
    "empty": emptied,
    "upside down": upside_down,
    "wrongly coloured": recoloured,
}


def main() -> None:
    """Draw every view of the tests' recordings, and keep what is drawn."""
    from tempfile import TemporaryDirectory

    from tests.recordings.test_views import drawn_views

    KEPT.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder:
        for name, picture in drawn_views(Path(folder)):
            with Image.open(picture) as image:
                image.convert("RGB").resize(SIZE, Image.Resampling.BOX).save(kept(name), optimize=True)


if __name__ == "__main__":
    main()

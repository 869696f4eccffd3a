"""Contrast of the page's colours, computed from its stylesheet in the light and in the dark theme."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import pytest

import stopgo.site

STYLE = (Path(stopgo.site.__file__).parent / "pages" / "site.css").read_text(encoding="utf-8")
TEXT, SHAPE = 4.5, 3.0
"""Least ratios by WCAG 2.2: of text (1.4.3), and of what a shape is known by (1.4.11)."""
TEXTS = [*product(("--ink", "--soft", "--bad"), ("--paper", "--panel")), ("--on-accent", "--accent"),
         ("--soft", "--floor"), ("#16181d", "--held"), ("#16181d", "--lost"), ("#fff", "--stop")]  # fmt: skip
"""Text on the background that it lies on, where a rule does not name both."""
SHAPES = [*product(("--seen", "--lost", "--coming", "--robot", "--accent"), ("--paper", "--floor")),
          *product(("--good", "--bad", "--accent", "--stop"), ("--paper",)), ("--paper", "--seen"),
          ("--paper", "--lost"), ("--ink", "--paper"), ("--held", "--stop")]  # fmt: skip


def themes() -> dict[str, dict[str, str]]:
    """The variables of each theme."""
    light, dark = (
        dict(re.findall(r"(--[\w-]+): (#\w+)", block))
        for block in re.findall(r":root \{(.*?)\}", STYLE, re.S)
    )
    return {"light": light, "dark": {**light, **dark}}


def luminance(colour: str) -> float:
    plain = colour.removeprefix("#")
    whole = plain if len(plain) == 6 else "".join(2 * one for one in plain)
    parts = [int(whole[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    r, g, b = (one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def named_together() -> list[tuple[str, str]]:
    """Text and background that one rule names."""
    found = []
    for body in re.findall(r"\{([^{}]*)\}", STYLE):
        text = re.search(r"(?<![\w-])color: (?:var\()?(#\w+|--[\w-]+)", body)
        under = re.search(r"background: (?:var\()?(#\w+|--[\w-]+)", body)
        if text and under:
            found.append((text[1], under[1]))
    return found


def test_the_ratio_is_that_of_the_standard() -> None:
    assert contrast("#000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#fff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_texts_and_shapes_stand_out(theme: str) -> None:
    colours = themes()[theme]
    pairs = [(pair, TEXT) for pair in (*TEXTS, *named_together())] + [(pair, SHAPE) for pair in SHAPES]
    assert len(named_together()) > 5
    ratios = {pair: (contrast(*(colours.get(one, one) for one in pair)), least) for pair, least in pairs}
    assert {pair: round(ratio, 2) for pair, (ratio, least) in ratios.items() if ratio < least} == {}

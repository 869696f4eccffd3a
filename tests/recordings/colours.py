"""Colours as eyes see them: simulated colour blindness, distance, and contrast."""

from __future__ import annotations

import numpy as np

from stopgo.recordings.drawing.palette import Colour

EYES = {
    "all colours": np.eye(3),
    "protanopia": np.array(
        [(0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998)]
    ),
    "deuteranopia": np.array(
        [(0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881)]
    ),
    "tritanopia": np.array(
        [(1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602), (0.004733, 0.691367, 0.303900)]
    ),
}
"""Linear RGB as each kind of eye sees it (Machado, Oliveira and Fernandes 2009, severity 1)."""
TO_XYZ = np.array([(0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750),
                   (0.0193339, 0.1191920, 0.9503041)])  # fmt: skip
WHITE = TO_XYZ.sum(axis=1)


def distance(a: Colour, b: Colour, eye: str) -> float:
    """ΔE (CIE 1976) between two colours as an eye sees them."""
    return float(np.linalg.norm(_lab(_linear(a), eye) - _lab(_linear(b), eye)))


def contrast(a: Colour, b: Colour) -> float:
    """The ratio of relative luminances, from 1 to 21 (WCAG 2)."""
    low, high = sorted(float(TO_XYZ[1] @ _linear(colour)) for colour in (a, b))
    return (high + 0.05) / (low + 0.05)


def _linear(colour: Colour) -> np.ndarray:
    value = np.array(colour[:3]) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray, eye: str) -> np.ndarray:
    ratio = TO_XYZ @ np.clip(EYES[eye] @ linear, 0, 1) / WHITE
    f = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])

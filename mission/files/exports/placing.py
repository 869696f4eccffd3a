"""Georeference and map pose of a mission as the user types them; its file stays unchanged."""

from __future__ import annotations

import math

import msgspec

from stopgo.mission.document import Frame, Mission
from stopgo.mission.document.problems import FAR
from stopgo.mission.errors import InputError
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.frames.transform import SiteOrigin, Transform
from stopgo.mission.settings import PARAMETERS
from stopgo.mission.settings.parameter import numbers

MAP = "write X,Y,HEADING in metres and degrees, such as 1.5,2,90"


def placed(mission: Mission, *, origin: str | None, to_map: str | None) -> Mission:
    """Return the mission with georeference `LAT,LON,ALT,HEADING` and map pose `X,Y,HEADING`, if given.

    Raises
    ------
    InputError
        Naming the option, what was typed, and how to write it.
    """
    if origin is not None:
        mission = msgspec.structs.replace(mission, georeference=_site_origin(origin))
    if to_map is not None:
        frame = Frame(name=mission.frame.name, to_map=map_transform(to_map))
        mission = msgspec.structs.replace(mission, frame=frame)
    return mission


def map_transform(text: str) -> Transform:
    """Return the site's transform to a map or to a log's frame, from `--map X,Y,HEADING`.

    Raises
    ------
    InputError
        When it is not three numbers, or one is beyond any site.
    """
    try:
        found = numbers(text)
    except ValueError:
        raise InputError(f"--map {text}: {MAP}") from None
    if len(found) != 3 or not all(abs(number) < FAR for number in found):
        raise InputError(f"--map {text}: {MAP}")
    return Transform(x=found[0], y=found[1], heading=math.radians(found[2]))


def moved(mission: Mission, there: Mission) -> tuple[str, ...]:
    """Return a note if `there` has another georeference than the mission."""
    own = mission.georeference
    if own is None or own == there.georeference:
        return ()
    return (
        f"--origin differs from the mission's own georeference {own.lat:.7f},{own.lon:.7f},{own.alt:g},"
        f"{own.heading_deg:g}, which push goes by; plan with it to change that",
    )


def _site_origin(text: str) -> SiteOrigin:
    """Checked as the same option of `stopgo plan`."""
    place = read_settings(None, {"origin": PARAMETERS["origin"].given(text)}).origin
    assert place is not None
    lat, lon, alt, heading = place
    return SiteOrigin(lat=lat, lon=lon, alt=alt, heading_deg=heading)

"""Whether a vehicle's metres count from the mission's georeference."""

from __future__ import annotations

from stopgo.bridge.mavlink.line.peer import Peer
from stopgo.mission.errors import NegativeResult
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import VehicleOrigin, origin_distance


def check_origin(peer: Peer, site: SiteOrigin, *, set_it: bool = False) -> VehicleOrigin:
    """The vehicle's origin, which is the site's; with `set_it` one that has none is given it.

    A vehicle takes one origin per boot and ignores a second silently; without one it accepts a mission,
    arms, and drives as if it stood at 0, 0.

    Raises
    ------
    AnswerIsNo
        If it has another one, or none, or does not tell.
    """
    held = peer.origin()
    wanted = VehicleOrigin(lat=site.lat, lon=site.lon, alt=site.alt)
    if held is None and set_it:
        held = peer.set_origin(wanted)
    if held is None:
        tried = (
            "and takes none (does its navigation run?)" if set_it else "or does not tell: add --set-origin"
        )
        raise NegativeResult(
            f"{peer} has no origin, {tried}, or --any-origin if it finds its place by satellites; "
            "nothing was sent"
        )
    away = origin_distance(site, held.place)
    if away:
        raise NegativeResult(
            f"{peer}: its origin {_told(held)} is {away} from the mission's {_told(wanted)}, "
            "and so would every stop be; an origin is taken once per boot: restart it and push with "
            "--set-origin, or --any-origin if it finds its place by satellites; nothing was sent"
        )
    return held


def _told(origin: VehicleOrigin) -> str:
    return f"{origin.lat:.7f}, {origin.lon:.7f}"

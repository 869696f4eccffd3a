"""Check that a vehicle's origin is the mission's georeference."""

from __future__ import annotations

from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import NegativeResult
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import VehicleOrigin, origin_distance


def check_origin(peer: Peer, site: SiteOrigin, *, set_it: bool = False) -> VehicleOrigin:
    """Check that the vehicle's origin is the site's, and return it; `set_it` sets one that is missing.

    A vehicle takes one origin per boot and ignores a second silently. Without one it accepts a mission,
    arms, and drives as if its position were 0, 0.

    Raises
    ------
    AnswerIsNo
        If it has another one, or none, or does not report it.
    """
    held = peer.origin()
    wanted = VehicleOrigin(lat=site.lat, lon=site.lon, alt=site.alt)
    if held is None and set_it:
        held = peer.set_origin(wanted)
    if held is None:
        tried = "and takes none (does its navigation run?)" if set_it else "or reports none: add --set-origin"
        raise NegativeResult(
            f"{peer} has no origin, {tried}, or --skip-origin-check if it finds its position by satellites; "
            "nothing was sent"
        )
    away = origin_distance(site, held.place)
    if away:
        raise NegativeResult(
            f"{peer}: its origin {_degrees(held)} is {away} from the mission's {_degrees(wanted)}, "
            "and so would every stop be; an origin is taken once per boot: restart it and push with "
            "--set-origin, or --skip-origin-check if it finds its position by satellites; nothing was sent"
        )
    return held


def _degrees(origin: VehicleOrigin) -> str:
    return f"{origin.lat:.7f}, {origin.lon:.7f}"

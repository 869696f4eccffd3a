"""What `push`, `fetch-mission` and `clear` do with an autopilot, and what they print."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_args

from stopgo.bridge.console import Bar, print_json, say, tell, tell_lines
from stopgo.bridge.mavlink.auto.logbook import forget, logbook, remember
from stopgo.bridge.mavlink.auto.unfinished_run import check_run_over
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import (
    NOTHING_SENT,
    Uploaded,
    check_mission_idle,
    clear,
    if_stopped,
    upload,
)
from stopgo.bridge.mavlink.transfer.upload_recovery import own_items
from stopgo.bridge.mavlink.vehicle_link.origin import check_origin
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import read_link
from stopgo.mission.console.table import table
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.exports import qgc_plan, qgc_waypoints
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.accuracy import why_beside
from stopgo.mission.mavlink.autopilots import AUTOPILOTS, autopilot_named
from stopgo.mission.mavlink.fields import PLACED
from stopgo.mission.mavlink.items import Command, Item, ItemList, MavFrame
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.read_back import home_item
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.mavlink.translation_options import ScanWait, Settle, Trigger

ITEMS = ("items", 1)
T = TypeVar("T", bound=str)


@dataclass(frozen=True)
class Line:
    """Which vehicle, and how it is spoken to."""

    url: str
    vehicle: int | None = None
    signing_key: Path | None = None
    insecure: bool = False
    autopilot: str | None = None
    """Its kind, if its heartbeat is not to be believed."""
    timeout_s: float = 5.0


@dataclass(frozen=True)
class Writing:
    """How a mission becomes items; `translate` says what each means."""

    trigger: str = "auto"
    scan_wait: str = "delay"
    settle: str = "delay"


@dataclass(frozen=True)
class Leave:
    """What is not done unless it is asked for."""

    set_origin: bool = False
    any_origin: bool = False
    while_running: bool = False


def push_mission(
    mission: Mission, line: Line, *, writing: Writing, leave: Leave, state: Path | None, as_json: bool
) -> None:
    """Put a mission on an autopilot, see it there, and note down that it is there."""
    made = None if line.autopilot is None else _translated(mission, line.autopilot, writing)
    with ExitStack() as opened:
        with if_stopped(say, lambda: NOTHING_SENT):
            url, peer = opened.enter_context(_peer(line))
        sent = made or _translated(mission, peer.autopilot.name, writing)
        if not leave.while_running:
            with logbook(url, peer.who.system, state) as book:
                check_run_over(peer, url, book, "a push")
        check_mission_idle(peer, leave.while_running)
        site = sent.origin
        with if_stopped(say, lambda: NOTHING_SENT):
            origin = None if leave.any_origin else check_origin(peer, site, set_it=leave.set_origin)
        beside = _why_beside(peer, mission)
        if beside:
            say(beside)
        with Bar("pushing", ITEMS) as bar:
            done = upload(peer, sent, while_running=leave.while_running, progress=bar.show, report=say)
        _note_down(url, peer, mission, sent, state, done)
        for note in sent.notes:
            say(f"note: {note}")
        notes = (beside, *sent.notes) if beside else sent.notes
        _report_push(peer, mission, replace(sent, notes=notes), done, origin, as_json)


def fetch_mission(line: Line, *, out: Path | None, as_json: bool) -> None:
    """Read what an autopilot holds, and show it or write it to a file."""
    if out is not None:
        _check_suffix(out)
    with _peer(line) as (_, peer), Bar("fetching", ITEMS) as bar:
        read = download(peer, progress=bar.show)
        origin = None if out is None else peer.origin()
    own = own_items(peer, read)
    if out is not None:
        write_atomic(out, FILES[out.suffix](peer, read, origin))
    if as_json:
        shown = {"file": str(out)} if out is not None else {"items": [_item_json(item) for item in own]}
        print_json({"vehicle": peer.who.system, "autopilot": peer.autopilot.name, "count": len(own), **shown})
    elif out is not None:
        tell(f"{out}: the {len(own)} items that {peer} holds")
    else:
        tell_lines(_page(peer, own))


def clear_mission(line: Line, *, state: Path | None, while_running: bool, as_json: bool) -> None:
    """Take the mission off an autopilot, see that it is gone, and note down that it is."""
    with _peer(line) as (url, peer), logbook(url, peer.who.system, state) as book:
        if not while_running:
            check_run_over(peer, url, book, "to clear it")
        had = clear(peer, while_running=while_running, report=say)
        forget(book)
    if as_json:
        print_json({"vehicle": peer.who.system, "autopilot": peer.autopilot.name, "had": had})
    else:
        tell(f"{peer} holds no mission (it had {had} items)")


def _translated(mission: Mission, autopilot: str, writing: Writing) -> ItemList:
    return translate(
        mission,
        autopilot,
        trigger=_choice("--trigger", writing.trigger, get_args(Trigger)),
        scan_wait=_choice("--scan-wait", writing.scan_wait, get_args(ScanWait)),
        settle=_choice("--settle", writing.settle, get_args(Settle)),
    )


def _choice(option: str, text: str, known: tuple[T, ...]) -> T:
    for one in known:
        if one == text:
            return one
    raise InputError(f"{option} {text}: one of {', '.join(known)}")


@contextmanager
def _peer(line: Line) -> Iterator[tuple[Url, Peer]]:
    """The vehicle that is meant."""
    if line.autopilot is not None:
        _choice("--autopilot", line.autopilot, tuple(AUTOPILOTS))
    url, key = read_link(line.url, line.signing_key, insecure=line.insecure)
    with reached(url, vehicle=line.vehicle, signing_key=key, timeout_s=line.timeout_s) as peer:
        peer.autopilot = autopilot_named(line.autopilot) if line.autopilot else peer.autopilot
        yield url, peer


def _why_beside(peer: Peer, mission: Mission) -> str:
    """What its own parameters make of the mission's legs and tolerances, as far as it tells them."""
    kind = peer.autopilot
    return why_beside(
        mission, kind, read_parameters(peer, [kind.radius_parameter, *kind.steering.parameters])
    )


def _note_down(
    url: Url, peer: Peer, mission: Mission, sent: ItemList, state: Path | None, done: Uploaded
) -> None:
    """Whoever follows the run must know what was sent; a run of the same mission is left as it is."""
    with logbook(url, peer.who.system, state) as book:
        if not (done.already and book.listed is not None and book.listed.sent == sent):
            remember(book, mission, sent)


def _report_push(
    peer: Peer, mission: Mission, sent: ItemList, done: Uploaded, origin: VehicleOrigin | None, as_json: bool
) -> None:
    if as_json:
        print_json({
            "vehicle": peer.who.system, "autopilot": sent.autopilot, "mission_id": mission.id,
            "revision": mission.revision, "digest": mission.digest, "items": done.items,
            "stops": len(mission.stops), "already": done.already, "notes": list(sent.notes),
            "origin": _origin_json(origin),
        })  # fmt: skip
        return
    how = "held it already" if done.already else "read back and compared"
    tell(
        f"{peer} holds {mission.name} ({mission.id[:12]} revision {mission.revision}): "
        f"{done.items} items for {len(mission.stops)} stops, {how}"
    )


def _check_suffix(out: Path) -> None:
    if out.suffix not in FILES:
        raise InputError(f"{out}: what a vehicle holds is written to one of *{', *'.join(FILES)}")


def _json_file(peer: Peer, read: tuple[Item, ...], origin: VehicleOrigin | None) -> bytes:
    home_first = peer.autopilot.home_first
    document = {
        "schema": "stopgo/items",
        "version": 1,
        "vehicle": peer.who.system,
        "autopilot": peer.autopilot.name,
        "origin": _origin_json(origin),
        "home": _item_json(read[0]) if home_first and read else None,
        "items": [_item_json(item) for item in own_items(peer, read)],
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def _waypoints_file(peer: Peer, read: tuple[Item, ...], origin: VehicleOrigin | None) -> bytes:
    return qgc_waypoints.listed([_home(peer, read, origin), *own_items(peer, read)])


def _plan_file(peer: Peer, read: tuple[Item, ...], origin: VehicleOrigin | None) -> bytes:
    home, own = _home(peer, read, origin), own_items(peer, read)
    speeds = [item.params[1] for item in own if item.command == Command.DO_CHANGE_SPEED]
    place = (home.x / STEPS_PER_DEGREE, home.y / STEPS_PER_DEGREE, home.z)
    return qgc_plan.listed(own, peer.autopilot.name, home=place, speed=(*speeds, 1.0)[0])


FILES = {".json": _json_file, ".waypoints": _waypoints_file, ".plan": _plan_file}
"""What a vehicle holds, as a file of each suffix."""


def _home(peer: Peer, read: tuple[Item, ...], origin: VehicleOrigin | None) -> Item:
    """The vehicle's home where it is among its items, else its origin, else the first place."""
    if peer.autopilot.home_first and read:
        return read[0]
    if origin is not None:
        return home_item(SiteOrigin(lat=origin.lat, lon=origin.lon, alt=origin.alt, heading_deg=0.0))
    first = next(
        (item for item in read if item.command in PLACED), Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL)
    )
    return Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL, x=first.x, y=first.y)


def _origin_json(origin: VehicleOrigin | None) -> dict[str, float] | None:
    return None if origin is None else {"lat": origin.lat, "lon": origin.lon, "alt": origin.alt}


def _item_json(item: Item) -> dict[str, Any]:
    """An item; null stands for NaN, which means that nothing is said."""
    return {
        "command": item.command,
        "name": item.name,
        "frame": item.frame,
        "params": [None if math.isnan(param) else param for param in item.params],
        "x": item.x,
        "y": item.y,
        "z": None if math.isnan(item.z) else item.z,
        "autocontinue": item.autocontinue,
    }


def _page(peer: Peer, own: tuple[Item, ...]) -> str:
    sequence = peer.autopilot.sequence
    rows = [
        (str(sequence(index)), item.name, *(f"{param:g}" for param in item.params), str(item.x), str(item.y))
        for index, item in enumerate(own)
    ]
    head = ("item", "command", "param1", "param2", "param3", "param4", "x", "y")
    return f"{peer} holds {len(own)} items\n{table(head, rows)}"

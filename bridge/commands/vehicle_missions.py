"""The commands `push`, `fetch-mission` and `clear` for a vehicle with an autopilot."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stopgo.bridge.commands.vehicle_abilities import camera_note
from stopgo.bridge.console import Bar, print_json, print_line, print_text, say
from stopgo.bridge.mavlink.auto.logbook import forget, logbook
from stopgo.bridge.mavlink.auto.mission_push import PushConsent, check_pushable, send_and_remember
from stopgo.bridge.mavlink.auto.unfinished_run import check_run_over
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import (
    NOTHING_SENT,
    Uploaded,
    clear,
    if_stopped,
)
from stopgo.bridge.mavlink.transfer.upload_recovery import own_items
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import read_link
from stopgo.mission.console.table import counted, table
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.exports import qgc_plan, qgc_waypoints
from stopgo.mission.files.exports.format import Supplements, written_as
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.accuracy import accuracy_warning
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.fields import PLACED
from stopgo.mission.mavlink.items import Command, Item, ItemList, MavFrame
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.read_back import home_item

if TYPE_CHECKING:
    from stopgo.bridge.commands.connection import Connection

ITEMS = ("items", 1)
"""Unit of the progress bars."""


def push_mission(
    mission: Mission,
    connection: Connection,
    autopilot: str | None,
    *,
    items: Supplements,
    consent: PushConsent,
    state: Path | None,
    as_json: bool,
) -> None:
    """Upload a mission to an autopilot, verify it there, and store in the logbook that it was sent."""
    made = None if autopilot is None else qgc_plan.items_of(mission, items)
    with ExitStack() as opened:
        with if_stopped(say, lambda: NOTHING_SENT):
            url, peer = opened.enter_context(_peer(connection, autopilot))
        sent = made or qgc_plan.items_of(mission, replace(items, autopilot=peer.autopilot.name))
        origin = check_pushable(url, peer, mission, sent, consent, state=state, report=say)
        deviation = _path_deviation_note(peer, mission)
        if deviation:
            say(deviation)
        with Bar("pushing", ITEMS) as bar:
            done = send_and_remember(
                url, peer, mission, sent, state=state, while_running=consent.while_running,
                progress=bar.show, report=say,
            )  # fmt: skip
        found = (*sent.notes, camera_note(peer, sent))
        for note in filter(None, found):
            say(f"note: {note}")
        notes = tuple(filter(None, (deviation, *found)))
        _report_push(peer, mission, replace(sent, notes=notes), done, origin, as_json)


def fetch_mission(connection: Connection, autopilot: str | None, *, out: Path | None, as_json: bool) -> None:
    """Read the mission on an autopilot, and show it or write it to a file."""
    if out is not None:
        _check_suffix(out)
    with _peer(connection, autopilot) as (_, peer), Bar("fetching", ITEMS) as bar:
        read = download(peer, progress=bar.show)
        origin = None if out is None else peer.origin()
    own = own_items(peer, read)
    if out is not None:
        write_atomic(out, FILES[out.suffix](peer, read, origin))
    if as_json:
        shown = {"file": str(out)} if out is not None else {"items": [_item_json(item) for item in own]}
        print_json({"vehicle": peer.who.system, "autopilot": peer.autopilot.name, "count": len(own), **shown})
    elif out is not None:
        print_line(f"{out}: the {len(own)} items that {peer} holds")
    else:
        print_text(_items_table(peer, own))


def clear_mission(
    connection: Connection, autopilot: str | None, *, state: Path | None, while_running: bool, as_json: bool
) -> None:
    """Clear the mission on an autopilot, verify that it holds none, and store that in the logbook."""
    with _peer(connection, autopilot) as (url, peer), logbook(url, peer.who.system, state) as book:
        if not while_running:
            check_run_over(str(peer), book, "to clear it")
        had = clear(peer, while_running=while_running, report=say)
        forget(book)
    if as_json:
        print_json({"vehicle": peer.who.system, "autopilot": peer.autopilot.name, "had": had})
    else:
        print_line(f"{peer} holds no mission (it had {had} items)")


@contextmanager
def _peer(connection: Connection, autopilot: str | None) -> Iterator[tuple[Url, Peer]]:
    """Connect to the vehicle; the kind of the autopilot may be given, if its heartbeat names another."""
    written_as({"autopilot": autopilot})
    mavlink = connection.mavlink
    assert mavlink is not None
    url, key = read_link(mavlink.url, mavlink.signing_key, insecure=connection.insecure)
    with reached(url, vehicle=mavlink.vehicle, signing_key=key, timeout_s=connection.timeout_s) as peer:
        peer.autopilot = autopilot_named(autopilot) if autopilot else peer.autopilot
        yield url, peer


def _path_deviation_note(peer: Peer, mission: Mission) -> str:
    """Note if the vehicle's parameters, as far as it reports them, let it leave the legs or tolerances."""
    kind = peer.autopilot
    return accuracy_warning(
        mission, kind, read_parameters(peer, [kind.radius_parameter, *kind.steering.parameters])
    )


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
    how = "already held" if done.already else "read back and compared"
    print_line(
        f"{peer} holds {mission.name} ({mission.id[:12]} revision {mission.revision}): "
        f"{counted(done.items, 'item')} for {counted(len(mission.stops), 'stop')}, {how}"
    )


def _check_suffix(out: Path) -> None:
    if out.suffix not in FILES:
        raise InputError(f"{out}: unknown file format; write the mission to one of *{', *'.join(FILES)}")


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
    position = (home.x / STEPS_PER_DEGREE, home.y / STEPS_PER_DEGREE, home.z)
    return qgc_plan.listed(own, peer.autopilot.name, home=position, speed=(*speeds, 1.0)[0])


FILES = {".json": _json_file, ".waypoints": _waypoints_file, ".plan": _plan_file}
"""File formats of a fetched mission, by suffix."""


def _home(peer: Peer, read: tuple[Item, ...], origin: VehicleOrigin | None) -> Item:
    """Return the home item of the vehicle, else its origin, else the position of the first item."""
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
    """Return an item for JSON; null stands for NaN, which means "not given"."""
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


def _items_table(peer: Peer, own: tuple[Item, ...]) -> str:
    sequence = peer.autopilot.sequence
    rows = [
        (str(sequence(index)), item.name, *(f"{param:g}" for param in item.params), str(item.x), str(item.y))
        for index, item in enumerate(own)
    ]
    head = ("item", "command", "param1", "param2", "param3", "param4", "x", "y")
    return f"{peer} holds {counted(len(own), 'item')}\n{table(head, rows)}"

"""MAVSDK, a vehicle that is not ours, takes what the uploader sends, over a clean line and a bad one."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import Uploaded, clear, upload
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.read_back import differences
from tests.bridge.mavlink.lists import stops
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.ports import free_port

mavsdk = pytest.importorskip("mavsdk")
from mavsdk.plugins.mission_raw_server.mission_raw_server import MissionRawServer  # noqa: E402

SENT = stops(50)
WAIT_S = 20.0


@contextmanager
def vehicle() -> Iterator[tuple[Url, queue.Queue[Any]]]:
    """Its endpoint, and the missions that it reports."""
    port, given = free_port(), queue.Queue[Any]()
    kind = mavsdk.ComponentType.AUTOPILOT
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        server = MissionRawServer(sdk.server_component())
        server.subscribe_incoming_mission(lambda result, plan, *rest: given.put((int(result), plan)))
        yield Url("udpout", "127.0.0.1", port), given
    finally:
        sdk.destroy()


def item_of(read: Any) -> Item:
    params = (read.param1, read.param2, read.param3, read.param4)
    return Item(
        read.command, read.frame, params, read.x, read.y, read.z, autocontinue=bool(read.autocontinue)
    )


def test_mavsdk_is_given_every_item_and_reads_it_back() -> None:
    with vehicle() as (url, given), reached(url, vehicle=1) as peer:
        assert peer.autopilot.name == "generic"
        assert upload(peer, SENT) == Uploaded(items=100, already=False)
        result, plan = given.get(timeout=WAIT_S)
        assert result == 1  # success
        assert [item_of(item) for item in plan.mission_items] == list(SENT.items)
        assert differences(SENT, download(peer)) == ()
        assert upload(peer, SENT).already
        assert clear(peer) == 100
        assert download(peer) == ()


def test_mavsdk_is_given_every_item_over_a_bad_line() -> None:
    """It gives its items only in order, one at a time: reading them back takes longer than sending them."""
    rough, sent = Roughness(delay_s=0.01, loss=0.1, doubled=0.05, overtaken=0.05), stops(15)
    with vehicle() as (url, given), Lossy(url.number, rough, seed=1) as line:
        with reached(line.url, vehicle=1) as peer:
            assert upload(peer, sent).items == 30
        missions = [given.get(timeout=WAIT_S)]
        while not given.empty():
            missions.append(given.get())
        assert [item_of(item) for item in missions[-1][1].mission_items] == list(sent.items)

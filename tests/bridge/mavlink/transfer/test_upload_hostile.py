"""An upload goes on while somebody hostile throws frames at the station's port, signed or not."""

from __future__ import annotations

import socket
import threading

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import clear, upload
from stopgo.bridge.mavlink.transfer.upload_recovery import own_items
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from tests.bridge.mavlink.hostile import Hostile
from tests.bridge.mavlink.lists import stops
from tests.ports import free_port

KEY = bytes(range(32))


@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_missions_arrive_among_ten_thousand_hostile_datagrams(key: bytes | None) -> None:
    port = free_port()
    listening = Url("udpin", "127.0.0.1", port)
    vehicle = vehicle_on(
        Url("udpout", "127.0.0.1", port), VehicleSetup(PROFILES["ardupilot"]), signing_key=key
    )
    thrower = threading.Thread(target=throw, args=(port,))
    with vehicle, reached(listening, vehicle=1, signing_key=key) as peer:
        thrower.start()
        rounds = 0
        while thrower.is_alive() or rounds == 0:
            rounds += 1
            assert upload(peer, stops(25, "ardupilot")).items == 50
            assert clear(peer) == 50
        thrower.join()
        assert own_items(peer, download(peer)) == ()
        assert peer.wire.dropped["unreadable"] > 1000


def throw(port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        for datagram in Hostile(seed=11).datagrams(10_000):
            line.sendto(datagram, ("127.0.0.1", port))

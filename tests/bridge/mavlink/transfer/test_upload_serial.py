"""An upload over a serial line, one item at a time; and one whose plug is pulled."""

from __future__ import annotations

import os
import pty
import select
import termios
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.transfer.upload import Uploaded, upload
from stopgo.bridge.mavlink.vehicle_link import transport
from stopgo.bridge.mavlink.vehicle_link.peer import reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.errors import OutcomeUnknown
from tests.bridge.mavlink.lists import stops


class NullModem:
    """Two serial devices, joined: what is written to one is read from the other."""

    def __init__(self, folder: Path) -> None:
        self.near, self.far = folder / "ttyS0", folder / "ttyS1"
        self._ends: dict[int, int] = {}
        masters = [self._plugged(self.near), self._plugged(self.far)]
        self._across = dict(zip(masters, reversed(masters), strict=True))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def pull(self) -> None:
        """End both devices."""
        self._closing.set()
        self._thread.join()
        for master, device in self._ends.items():
            os.close(device)
            os.close(master)
        self._ends.clear()

    def _plugged(self, path: Path) -> int:
        master, device = pty.openpty()
        for end in (master, device):
            tty.setraw(end, termios.TCSANOW)
        path.symlink_to(os.ttyname(device))
        self._ends[master] = device
        return master

    def _carry(self) -> None:
        while not self._closing.is_set():
            for end in select.select(list(self._across), [], [], 0.05)[0]:
                os.write(self._across[end], os.read(end, 4096))


@pytest.fixture
def line(tmp_path: Path) -> Iterator[NullModem]:
    made = NullModem(tmp_path)
    yield made
    made.pull()


SENT = stops(20, "ardupilot")


def test_a_mission_goes_over_a_serial_line(line: NullModem) -> None:
    with (
        vehicle_on(Url("serial", str(line.far), 57600), VehicleSetup(PROFILES["ardupilot"])),
        reached(Url("serial", str(line.near), 57600), vehicle=1) as peer,
    ):
        assert upload(peer, SENT) == Uploaded(items=40, already=False)


def test_a_pulled_plug_leaves_it_unknown(line: NullModem) -> None:
    def pull(done: int, total: int) -> None:
        if done == 10:
            line.pull()

    said = r"no data after 1\d of 41 items had arrived .*serial port is disconnected.*do not start it"
    with (
        vehicle_on(Url("serial", str(line.far), 57600), VehicleSetup(PROFILES["ardupilot"])),
        reached(Url("serial", str(line.near), 57600), vehicle=1, timeout_s=2.0) as peer,
        pytest.raises(OutcomeUnknown, match=said),
    ):
        upload(peer, SENT, progress=pull)


def test_what_is_written_while_a_lost_line_is_closed_is_lost_and_no_more(line: NullModem) -> None:
    """A reader that meets a pulled plug closes the port; for a moment it has no descriptor and is open."""
    end = transport.Serial(Url("serial", str(line.near), 57600))
    try:
        descriptor, end._port.fd = end._port.fd, None
        end.write(b"heartbeat")
        assert end.read(0.0) == []
        assert "serial port is disconnected" in end.disconnected
    finally:
        os.close(descriptor)
        end.close()

"""A URL says how a vehicle is reached; what leaves this machine is signed, or wanted unsigned."""

from __future__ import annotations

import pytest

from stopgo.bridge.mavlink.vehicle_link.url import Url, check_guarded, read_url
from stopgo.mission.errors import InputError


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:0.0.0.0:14550", Url("udpin", "0.0.0.0", 14550)),
        ("udpout:127.0.0.1:14550", Url("udpout", "127.0.0.1", 14550)),
        ("udpout://127.0.0.1:14550", Url("udpout", "127.0.0.1", 14550)),
        ("tcp:robot.local:5760", Url("tcp", "robot.local", 5760)),
        ("tcpin:[::1]:5760", Url("tcpin", "::1", 5760)),
        ("serial:/dev/ttyUSB0:57600", Url("serial", "/dev/ttyUSB0", 57600)),
        ("serial:///dev/ttyUSB0:57600", Url("serial", "/dev/ttyUSB0", 57600)),
        ("serial:/dev/serial/by-id/usb-0:1.2:57600", Url("serial", "/dev/serial/by-id/usb-0:1.2", 57600)),
    ],
)
def test_each_kind_is_read(text: str, url: Url) -> None:
    assert read_url(text) == url
    assert read_url(str(url)) == url


def test_an_ipv6_address_is_shown_in_brackets() -> None:
    assert str(read_url("udpout://[::1]:24550")) == "udpout:[::1]:24550"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not a MAVLink URL"),
        ("udp:127.0.0.1:14550", "not a MAVLink URL"),
        ("udpout:127.0.0.1", "not a MAVLink URL"),
        ("udpout::14550", "not a MAVLink URL"),
        ("udpout:127.0.0.1:x", "not a MAVLink URL"),
        ("udpout:127.0.0.1:²", "not a MAVLink URL"),
        ("udpout:127.0.0.1:0", "0 is no port"),
        ("tcp:127.0.0.1:65536", "65536 is no port"),
        ("serial:/dev/ttyUSB0:300", "300 is no baud rate"),
    ],
)
def test_what_is_none_is_refused_with_an_example(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_url(text)


@pytest.mark.parametrize("text", ["udpin:0.0.0.0:14550", "tcp:192.168.1.7:5760", "udpout:robot.local:14550"])
def test_what_leaves_this_machine_is_guarded(text: str) -> None:
    url = read_url(text)
    with pytest.raises(InputError, match=r"leaves this machine unsigned; .*--signing-key FILE.*--insecure"):
        check_guarded(url, signed=False, insecure=False)
    check_guarded(url, signed=True, insecure=False)
    check_guarded(url, signed=False, insecure=True)


@pytest.mark.parametrize("text", ["udpin:127.0.0.1:14550", "tcpin:[::1]:5760", "serial:/dev/ttyACM0:115200"])
def test_what_stays_here_is_not(text: str) -> None:
    check_guarded(read_url(text), signed=False, insecure=False)

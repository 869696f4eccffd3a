"""Two vehicles with one system id stay two, and one vehicle may change its address."""

from __future__ import annotations

import pytest

from stopgo.bridge.mavlink.vehicle_link.sender_addresses import GONE_S, MOVED_S, SenderAddresses


class Heard:
    """Messages of system 1 from two addresses, at times of the test's own."""

    def __init__(self) -> None:
        self.addresses = SenderAddresses()

    def __call__(self, at_s: float, address: str, component: int = 1) -> bool:
        return self.addresses.accepts(1, component, address, at_s)


@pytest.fixture
def heard() -> Heard:
    return Heard()


def test_of_two_vehicles_with_one_id_only_the_first_is_heard_and_sent_to(heard: Heard) -> None:
    senders = [(0.0, "first"), (0.4, "second"), (1.0, "first"), (1.4, "second"), (4.9, "second")]
    assert [heard(*one) for one in senders] == [True, False, True, False, False]
    assert heard.addresses.address(1, 1) == "first"
    assert heard.addresses.doubled(1) == ["first", "second"]


def test_a_vehicle_that_comes_back_from_another_port_is_heard_again(heard: Heard) -> None:
    assert heard(0.0, "first")
    assert not heard(0.1, "second")
    assert heard(MOVED_S + 0.1, "second")
    assert heard.addresses.address(1, 1) == "second"
    assert heard.addresses.doubled(1) == []


def test_a_second_vehicle_is_heard_once_the_first_has_long_been_silent(heard: Heard) -> None:
    assert [heard(0.0, "first"), heard(0.5, "second"), heard(1.0, "first")] == [True, False, True]
    assert not heard(GONE_S, "second")
    assert heard(GONE_S + 1.1, "second")
    assert heard.addresses.doubled(1) == []


def test_what_is_no_autopilot_may_send_from_everywhere(heard: Heard) -> None:
    assert all(heard(number / 10, str(number % 2), component=190) for number in range(10))
    assert heard.addresses.doubled(1) == []

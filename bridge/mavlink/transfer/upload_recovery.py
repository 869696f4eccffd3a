"""Recovery after an upload that failed: half a mission is replaced by the old one, or by none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.flow_control import window_for
from stopgo.bridge.mavlink.transfer.sending import send_items
from stopgo.bridge.mavlink.vehicle_link.messages import ack_message, clear_all
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item

CANCELS = 3
"""A cancel is not answered, so it is sent this often."""
CLEARED_S = 1.0
"""Longest wait for the answer to CLEAR_ALL."""


@dataclass(frozen=True)
class VehicleContent:
    """Content of a vehicle after an upload that failed, as a text for people."""

    text: str
    known: bool = True


def recovered_content(peer: Peer, before: Sequence[Item]) -> VehicleContent:
    """Read the content after a failed upload, and replace half a mission by the one before or by none."""
    if peer.autopilot.behaviour.atomic:
        try:
            held = download(peer)
        except (NegativeResult, RobotUnreachable):
            return unknown_content(peer)
        if _same(peer, held, before):
            return _content_before(peer, before, "still")
    return _restored(peer, before)


def _restored(peer: Peer, before: Sequence[Item]) -> VehicleContent:
    """Put back the mission from before, or else clear the vehicle."""
    if own_items(peer, before):
        ended = send_items(peer, before, window=window_for(peer))
        if ended.how == "silent":
            return unknown_content(peer)
        if _holds(peer, before):
            return _content_before(peer, before, "again")
    if clear_items(peer):
        was = "" if not own_items(peer, before) else "; the mission it had could not be put back"
        return VehicleContent(f"it holds no mission{was}")
    return unknown_content(peer)


def _content_before(peer: Peer, before: Sequence[Item], how: str) -> VehicleContent:
    count = len(own_items(peer, before))
    return VehicleContent(
        f"it {how} holds the mission it had before ({count} items)" if count else "it holds no mission"
    )


def unknown_content(peer: Peer) -> VehicleContent:
    """The content where it could not be read."""
    return VehicleContent(
        f"what it holds now is unknown{peer.why_silent()}: it may be half a mission, so do not start it "
        "before stopgo fetch-mission, stopgo clear or another push has succeeded",
        known=False,
    )


def own_items(peer: Peer, read: Sequence[Item]) -> tuple[Item, ...]:
    """The items that were read, without the vehicle's home."""
    return tuple(read[1:] if peer.autopilot.home_first else read)


def cancel(peer: Peer) -> None:
    """Cancel the transfer at the vehicle."""
    for _ in range(CANCELS):
        peer.send(ack_message(MissionResult.OPERATION_CANCELLED, peer.who))


def clear_items(peer: Peer) -> bool:
    """Clear the vehicle's list of items; true if it was read as empty."""
    send_items(peer, (), window=1)
    if peer.silent_s > peer.patience_s:
        return False
    if _holds(peer, ()):
        return True
    with peer.waiting("MISSION_ACK") as waiting:
        peer.send(clear_all(peer.who))
        waiting.get(CLEARED_S)
    return _holds(peer, ())


def _holds(peer: Peer, items: Sequence[Item]) -> bool:
    try:
        return _same(peer, download(peer), items)
    except (NegativeResult, RobotUnreachable):
        return False


def _same(peer: Peer, one: Sequence[Item], other: Sequence[Item]) -> bool:
    """True if two lists that were read are equal without homes; a NaN equals another."""
    return [repr(item) for item in own_items(peer, one)] == [repr(item) for item in own_items(peer, other)]

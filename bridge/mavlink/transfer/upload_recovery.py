"""What is on a vehicle after an upload that failed; half a mission is replaced by the old one or by none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stopgo.bridge.mavlink.line.messages import ack_message, clear_all
from stopgo.bridge.mavlink.line.peer import Peer
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.flow_control import window_for
from stopgo.bridge.mavlink.transfer.sending import send_items
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item

CANCELS = 3
"""A cancel is not answered, so it is said so often."""
CLEARED_S = 1.0
"""For the answer to CLEAR_ALL."""


@dataclass(frozen=True)
class Left:
    """What is on a vehicle after an upload that failed."""

    words: str
    known: bool = True


def left_on(peer: Peer, before: Sequence[Item]) -> Left:
    """See what a failed upload left, and make good what is neither the mission before nor none."""
    if peer.autopilot.behaviour.atomic:
        try:
            held = download(peer)
        except (NegativeResult, RobotUnreachable):
            return unknown(peer)
        if _same(peer, held, before):
            return _as_before(peer, before, "still")
    return _restored(peer, before)


def _restored(peer: Peer, before: Sequence[Item]) -> Left:
    """Put back what was there before, or else nothing."""
    if own_items(peer, before):
        ended = send_items(peer, before, window=window_for(peer))
        if ended.how == "silent":
            return unknown(peer)
        if _holds(peer, before):
            return _as_before(peer, before, "again")
    if emptied(peer):
        was = "" if not own_items(peer, before) else "; the mission it had could not be put back"
        return Left(f"it holds no mission{was}")
    return unknown(peer)


def _as_before(peer: Peer, before: Sequence[Item], how: str) -> Left:
    count = len(own_items(peer, before))
    return Left(
        f"it {how} holds the mission it had before ({count} items)" if count else "it holds no mission"
    )


def unknown(peer: Peer) -> Left:
    """What is said where it could not be seen."""
    return Left(
        f"what it holds now is unknown{peer.why_silent()}: it may be half a mission, so do not start it "
        "before stopgo fetch-mission, stopgo clear or another push has gone through",
        known=False,
    )


def own_items(peer: Peer, read: Sequence[Item]) -> tuple[Item, ...]:
    """What was read without the vehicle's home."""
    return tuple(read[1:] if peer.autopilot.home_first else read)


def cancel(peer: Peer) -> None:
    """Tell the vehicle that the transfer ends here."""
    for _ in range(CANCELS):
        peer.send(ack_message(MissionResult.OPERATION_CANCELLED, peer.who))


def emptied(peer: Peer) -> bool:
    """Take everything off the vehicle; whether it was seen empty."""
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
    """Whether two lists that were read are the same, homes aside; a NaN is the same as another."""
    return [repr(item) for item in own_items(peer, one)] == [repr(item) for item in own_items(peer, other)]

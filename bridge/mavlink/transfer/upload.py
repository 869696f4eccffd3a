"""Upload of a mission to a vehicle: sent, read back and compared; a failure says what the vehicle holds.

An acknowledgement is no proof of success, and silence none of failure: only the list that is read back
counts. After a failure no part of an upload remains that could be started. The mission from before is put
back, or the vehicle's mission is cleared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from stopgo.bridge.console import Progress
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.flow_control import window_for
from stopgo.bridge.mavlink.transfer.sending import TransferEnd, send_items
from stopgo.bridge.mavlink.transfer.upload_recovery import (
    cancel,
    clear_items,
    own_items,
    recovered_content,
    unknown_content,
)
from stopgo.bridge.mavlink.vehicle_link.messages import result_name
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.items import Item, ItemList
from stopgo.mission.mavlink.read_back import differences, upload_of

ATTEMPTS = 4
"""Whole transfers, where the vehicle ended one or the read-back was not what was sent."""
CLOCK_S = 2.0
"""Longest wait for the vehicle's clock after an upload."""
NOTHING_SENT = "nothing was sent of the mission; the vehicle holds what it held"
SHOWN = 3
"""Differences that an error names."""
LineReport = Callable[[str], None]
"""Takes a line for the user."""


@dataclass(frozen=True)
class Uploaded:
    """A mission that was seen on the vehicle, item by item."""

    items: int
    """Number of items that it holds, without its home."""
    already: bool
    """It held them before, and nothing was sent."""


@dataclass(frozen=True)
class Failure:
    """Reason why a mission is not on the vehicle."""

    why: str
    touched: bool = True
    """True if the vehicle's content may have changed."""
    too_few: bool = False
    """True if the vehicle holds fewer items than were sent."""


def upload(
    peer: Peer,
    sent: ItemList,
    *,
    while_running: bool = False,
    progress: Progress | None = None,
    report: LineReport = lambda line: None,
) -> Uploaded:
    """Put the items on the vehicle, and see them there as its kind of autopilot stores them.

    Parameters
    ----------
    while_running
        Upload though the vehicle follows a mission; it begins its current item again.
    progress
        Called with items done and to do: those sent, then those read back.
    report
        Takes the one line that says what is on the vehicle when a Ctrl-C has ended the upload. A second
        Ctrl-C does not wait until that was read, and the line says that it is unknown.

    Raises
    ------
    RobotUnreachable
        If the vehicle did not answer and nothing was sent.
    AnswerIsNo
        If the vehicle refused it; the message says what it holds now.
    OutcomeUnknown
        If what it holds is not known.
    """
    check_mission_idle(peer, while_running)
    with if_stopped(report, lambda: NOTHING_SENT):
        peer.ask_clock()
        boots = peer.boots
        before = download(peer)
    if not differences(sent, before):
        return Uploaded(len(sent.items), already=True)
    _replace(peer, sent, before, progress or (lambda done, total: None), report)
    _check_no_restart(peer, boots, report)
    return Uploaded(len(sent.items), already=False)


def _replace(
    peer: Peer, sent: ItemList, before: Sequence[Item], progress: Progress, report: LineReport
) -> None:
    """Replace the list that was read before, or raise with what the vehicle holds instead."""
    with if_stopped(report, lambda: _cancelled(peer, before, report)):
        failure = _attempted(peer, sent, progress)
    if failure is not None:
        with if_stopped(report, lambda: f"{failure.why}; {unknown_content(peer).text}"):
            raise _error(peer, failure, before)


def _check_no_restart(peer: Peer, boots: int, report: LineReport) -> None:
    """Refuse to call an upload complete during which the vehicle restarted."""
    with if_stopped(report, lambda: "all was sent and read back as it should be"):
        peer.clock_seen(patience_s=CLOCK_S)
    if peer.boots != boots:
        raise NegativeResult(
            f"{peer} was restarted during the upload, and may have lost its origin; it holds the "
            "mission: push it again to have the origin checked"
        )


@contextmanager
def if_stopped(report: LineReport, text: Callable[[], str]) -> Iterator[None]:
    """Report a line on the state of things to whoever stops the block by Ctrl-C or SIGTERM."""
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        report(text())
        raise


def _cancelled(peer: Peer, before: Sequence[Item], report: LineReport) -> str:
    """Line on the content after a cancelled upload; it is unknown if a second stop ends the reading."""
    with if_stopped(report, lambda: f"the upload was cancelled twice; {unknown_content(peer).text}"):
        cancel(peer)
        return f"the upload was cancelled; {recovered_content(peer, before).text}"


def clear(peer: Peer, *, while_running: bool = False, report: LineReport = lambda line: None) -> int:
    """Clear the vehicle's mission, and check that; return the number of items it had.

    `report` takes the line that says what is on the vehicle when a Ctrl-C has ended it.

    Raises
    ------
    RobotUnreachable, AnswerIsNo, OutcomeUnknown
        As `upload`.
    """
    check_mission_idle(peer, while_running, "would be left without one")
    with if_stopped(report, lambda: NOTHING_SENT):
        before = own_items(peer, download(peer))
    with if_stopped(report, lambda: unknown_content(peer).text):
        cleared = not before or clear_items(peer)
    if not cleared:
        raise OutcomeUnknown(
            f"{peer}: commanded to clear its mission of {len(before)} items, and does not show that"
            f"{peer.why_silent()}: what it holds is unknown; see stopgo fetch-mission"
        )
    return len(before)


def check_mission_idle(
    peer: Peer, while_running: bool, what: str = "would begin its current item again"
) -> None:
    """Refuse to change the mission that a vehicle is following; `what` would be the effect."""
    if peer.armed and peer.in_auto and not while_running:
        raise NegativeResult(
            f"{peer} is armed and follows its mission, and {what}; "
            "pause it first, or add --while-running; nothing was sent"
        )


def _attempted(peer: Peer, sent: ItemList, progress: Progress) -> Failure | None:
    """Send and read back until the two agree; `None` when they do."""
    items, window = upload_of(sent), window_for(peer)
    failure = Failure("nothing was tried", touched=False)
    for _ in range(ATTEMPTS):
        ended = send_items(peer, items, window=window, progress=lambda done, total: progress(done, 2 * total))
        if ended.how in ("accepted", "unsure"):
            seen = _read_back(peer, sent, progress)
            if seen is None or seen == failure:  # twice the same is no accident of the line
                return seen
            failure = seen
            if seen.too_few:  # it may have accepted the list before the last items had arrived
                window = 1
        elif ended.how == "refused" and (window == 1 or ended.result == MissionResult.NO_SPACE):
            return Failure(_refusal(sent, ended))
        elif ended.how in ("busy", "silent", "rebooted"):
            return _given_up(peer, ended, len(items))
        else:
            failure = Failure(f"it ended the transfer at item {ended.at} ({result_name(ended.result)})")
            window = 1  # then what is refused is the one item in flight
    return failure


def _read_back(peer: Peer, sent: ItemList, progress: Progress) -> Failure | None:
    """Compare the vehicle's list with the one that was sent."""
    count = len(upload_of(sent))
    try:
        read = download(peer, progress=lambda done, total: progress(count + done, count + total))
    except (NegativeResult, RobotUnreachable) as error:
        return Failure(f"all was sent, and could not be read back: {error}")
    lines = differences(sent, read)
    if not lines:
        return None
    more = f"; and {len(lines) - SHOWN} more" if len(lines) > SHOWN else ""
    why = f"all was sent, and read back otherwise: {'; '.join(lines[:SHOWN])}{more}"
    return Failure(why, too_few=len(read) < count)


def _refusal(sent: ItemList, ended: TransferEnd) -> str:
    """Text on a refused item: its purpose, and the field that was refused."""
    name = result_name(ended.result)
    if ended.result == MissionResult.NO_SPACE:
        return f"it refused {len(upload_of(sent))} items ({name}): plan fewer stops at once"
    index = autopilot_named(sent.autopilot).index(ended.at)
    if not 0 <= index < len(sent.placed):
        return f"it refused item {ended.at}, its home ({name})"
    placed = sent.placed[index]
    stop = f" of stop {placed.stop}" if placed.stop is not None else ""
    field = _field(placed.item, ended.result)
    return f"it refused item {ended.at}, {placed.item.name}, {placed.role}{stop}{field} ({name})"


def _field(item: Item, result: int) -> str:
    """The field that a refusal is about, with its value; empty if it names none."""
    values: dict[int, tuple[str, float]] = {
        MissionResult.UNSUPPORTED: ("command", item.command),
        MissionResult.UNSUPPORTED_FRAME: ("frame", item.frame),
        MissionResult.INVALID_PARAM1: ("param1", item.params[0]),
        MissionResult.INVALID_PARAM2: ("param2", item.params[1]),
        MissionResult.INVALID_PARAM3: ("param3", item.params[2]),
        MissionResult.INVALID_PARAM4: ("param4", item.params[3]),
        MissionResult.INVALID_PARAM5_X: ("x (latitude)", item.x),
        MissionResult.INVALID_PARAM6_Y: ("y (longitude)", item.y),
        MissionResult.INVALID_PARAM7: ("z", item.z),
    }
    if result not in values:
        return ""
    field, value = values[result]
    return f": {field} {value:.10g}"


def _given_up(peer: Peer, ended: TransferEnd, count: int) -> Failure:
    if ended.how == "busy":
        return Failure(
            f"it takes no mission now ({result_name(ended.result)}); another station may be uploading: "
            "try again",
            touched=False,
        )
    if ended.how == "rebooted":
        return Failure(f"it was restarted when {ended.at} of {count} items had arrived")
    return Failure(f"no data after {ended.at} of {count} items had arrived{peer.why_silent()}")


def _error(peer: Peer, failure: Failure, before: Sequence[Item]) -> NegativeResult | OutcomeUnknown:
    """The failure, with the vehicle's content now."""
    if not failure.touched:
        return NegativeResult(f"{peer}: {failure.why}; nothing of this mission was stored")
    content = recovered_content(peer, before)
    error = NegativeResult if content.known else OutcomeUnknown
    return error(f"{peer}: {failure.why}; {content.text}")

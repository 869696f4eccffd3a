"""A mission put onto a vehicle: refused while a run goes on, read back, and stored for following the run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from stopgo.bridge.console import Progress
from stopgo.bridge.mavlink.auto.logbook import logbook, remember
from stopgo.bridge.mavlink.auto.unfinished_run import check_run_over
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import (
    NOTHING_SENT,
    LineReport,
    Uploaded,
    check_mission_idle,
    if_stopped,
    upload,
)
from stopgo.bridge.mavlink.vehicle_link.origin import check_origin
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.document import Mission
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.read_back import differences


@dataclass(frozen=True)
class PushConsent:
    """Actions that a push takes only if the user asks for them."""

    set_origin: bool = False
    any_origin: bool = False
    while_running: bool = False


def check_pushable(
    url: Url,
    peer: Peer,
    mission: Mission,
    sent: ItemList,
    consent: PushConsent,
    *,
    state: Path | None,
    report: LineReport,
) -> VehicleOrigin | None:
    """Check that a mission may be sent, and return the vehicle's origin; `None` if it was not compared.

    The mission of a run that is held or paused may be sent to a vehicle that has lost it: the run goes on.

    Raises
    ------
    NegativeResult
        If a run is not over, the vehicle follows a mission, or its origin is another.
    """
    with if_stopped(report, lambda: NOTHING_SENT):
        if not consent.while_running:
            with logbook(url, peer.who.system, state) as book:
                is_held = book.run.state in ("HELD", "PAUSED")
                if not (is_held and book.was_sent(mission, sent) and differences(sent, download(peer))):
                    check_run_over(str(peer), book, "a push")
        check_mission_idle(peer, consent.while_running)
        return None if consent.any_origin else check_origin(peer, sent.origin, set_it=consent.set_origin)


def send_and_remember(
    url: Url,
    peer: Peer,
    mission: Mission,
    sent: ItemList,
    *,
    state: Path | None,
    while_running: bool = False,
    progress: Progress | None = None,
    report: LineReport = lambda line: None,
) -> Uploaded:
    """Upload the items, see them there, and store them.

    The run is left as it is if the vehicle held this very mission, or its run is not over and it had lost it.

    Raises
    ------
    RobotUnreachable, NegativeResult, OutcomeUnknown
        As `upload`.
    """
    done = upload(peer, sent, while_running=while_running, progress=progress, report=report)
    with logbook(url, peer.who.system, state) as book:
        is_kept = done.already or not book.run.over
        if not (is_kept and book.was_sent(mission, sent)):
            remember(book, mission, sent)
    return done

"""The lease: one identity at a time may command a robot, while it watches its run and for a minute after.

The lease belongs to an identity, not to a process, and outlives a reboot. Its fencing token grows with
every change of commander, so that a command given under an older one is recognised however late it comes.
"""

from __future__ import annotations

from typing import Final

import msgspec

from stopgo.mission.run.run_commands import Refused

LEASE_S: Final = 60.0
"""Time that a commander keeps the robot after the last command."""


class Lease(msgspec.Struct, frozen=True, kw_only=True):
    """Right of one identity to command a robot."""

    commander: str
    fence: int
    """Fencing token; grows with every change of commander."""
    until_ns: int


def claimed(
    lease: Lease | None, commander: str, *, fence: int | None, take_over: bool, now_ns: int
) -> Lease | Refused:
    """Return the lease of `commander`, renewed; refused while another holds it.

    `fence` is the fencing token that the commander last knew. One older than the robot's is refused unless
    the command takes over.
    """
    if lease is None:
        return Lease(commander=commander, fence=1, until_ns=now_ns + lasting_ns())
    if fence is not None and fence < lease.fence and not take_over:
        return Refused(
            "fenced", f"fencing token is {fence}; the robot's is {lease.fence} ({lease.commander})"
        )
    if commander == lease.commander:
        return msgspec.structs.replace(lease, until_ns=now_ns + lasting_ns())
    left_s = remaining_s(lease, now_ns)
    if left_s > 0 and not take_over:
        return Refused(
            "not_the_commander",
            f"{lease.commander} commands it for {left_s:.0f} s more; wait, or add --take-over",
        )
    return Lease(commander=commander, fence=lease.fence + 1, until_ns=now_ns + lasting_ns())


def renewed(lease: Lease | None, commander: str, *, now_ns: int) -> Lease | None:
    """Renew the lease for the commander who watches the run; `None` if there is nothing to renew.

    Renewal is not worth a write before half of the lease has passed.
    """
    if lease is None or lease.commander != commander or remaining_s(lease, now_ns) > LEASE_S / 2:
        return None
    return msgspec.structs.replace(lease, until_ns=now_ns + lasting_ns())


def remaining_s(lease: Lease, now_ns: int) -> float:
    """Seconds that the lease still lasts; never more than its full length, however the clock jumped."""
    return max(0.0, min(LEASE_S, (lease.until_ns - now_ns) / 1e9))


def lasting_ns() -> int:
    return round(LEASE_S * 1e9)

"""Parts of a mission that no autopilot executes itself: the station that follows the run must."""

from __future__ import annotations

from collections.abc import Iterator

from stopgo.mission.document import Mission
from stopgo.mission.mavlink.translation_options import TranslationOptions
from stopgo.mission.run.scans import needs_heading


def notes_of(mission: Mission, options: TranslationOptions) -> tuple[str, ...]:
    """Return a line for each part that the items do not carry."""
    return (*_failures(mission), *_arrival(mission, options), *_policy(mission))


def _failures(mission: Mission) -> Iterator[str]:
    retried = [stop.id for stop in mission.stops if stop.on_failure == "retry" and stop.retries > 0]
    if retried:
        yield f"{_some(retried)}: a failed scan is tried again only by the station that follows the run"
    for doing in ("ask", "abort", "home"):
        ids = [stop.id for stop in mission.stops if stop.on_failure == doing]
        if ids:
            yield f"{_some(ids)}: on_failure {doing} is done only by the station that follows the run"


def _arrival(mission: Mission, options: TranslationOptions) -> Iterator[str]:
    name, reached = options.vehicle.name, options.vehicle.reached
    yield f"{name} counts a stop as reached {reached}: the station checks tolerance_m before a scan"
    if needs_heading(mission.scanner):
        yield "headings are sent: the station checks them before a scan"
    if options.trigger == "none":
        yield "no item starts a scan: the station does"


def _policy(mission: Mission) -> Iterator[str]:
    policy = mission.policy
    yield (
        f"link_loss {policy.link_loss} and battery_min {policy.battery_min:g} are not sent: "
        "the vehicle has failsafe parameters of its own"
    )
    if policy.own_way is True:
        yield "own_way is not sent: the vehicle drives the legs"


def _some(ids: list[str]) -> str:
    """Format stop ids, as in "stop S1", or "stops S1 to S9 (9)"."""
    return f"stop {ids[0]}" if len(ids) == 1 else f"stops {ids[0]} to {ids[-1]} ({len(ids)})"

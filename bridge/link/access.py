"""Access rules for a robot's key expressions, at the robot and at a router: deny, unless a rule here allows.

zenoh applies these rules by the certificate of a link. At a robot every holder of the site's keys may ask and
listen. Message signatures decide who may command, for behind a router all messages come by one link. At a
router each robot is limited to its own key expressions, so none can act as another. A rule allows a message
only if it includes the message's whole key. To the other end a denied message looks like no answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from stopgo.bridge.link.keys import Holder
from stopgo.bridge.link.protocol import KeyExpressions

LOOKING = ("declare_liveliness_subscriber", "liveliness_query")


@dataclass(frozen=True)
class Flow:
    """Messages on some key expressions, between the ends that ask and the ends that serve."""

    name: str
    asked: tuple[str, ...] = ()
    """Questions."""
    told: tuple[str, ...] = ()
    """Publications, by those who serve."""
    said: tuple[str, ...] = ()
    """Publications to those who serve."""
    shown: tuple[str, ...] = ()
    """Tokens of those who serve."""
    signed_in: tuple[str, ...] = ()
    """Tokens shown to those who serve."""


def access_control(keys: KeyExpressions, *, admits: bool = False) -> dict[str, Any]:
    """Return zenoh's `access_control` at one robot: default deny; its own tunnel's end may connect too.

    If the robot admits connections itself, its own end is known by the Unix socket, else by its certificate.
    """
    every = [
        *_served(_everything(keys), "ingress", "egress"),
        *_served(_looking_for_twins(keys, "look out for"), "egress", "ingress"),
    ]
    # An end of the tunnel in a process of its own.
    own = _served(_own_tunnel(keys), "egress", "ingress")
    known_by = (
        {"link_protocols": ["unixsock-stream"]} if admits else {"cert_common_names": [f"robot:{keys.robot}"]}
    )
    return _control(
        [*every, *own],
        subjects=[{"id": "holder"}, {"id": "own"} | known_by],
        policies=[
            {"rules": _ids(every), "subjects": ["holder"]},
            {"rules": _ids(own), "subjects": ["own"]},
        ],
    )


def router_access_control(holders: Sequence[Holder], site: str | None) -> dict[str, Any]:
    """Return zenoh's `access_control` at a router: default deny, robots on their own keys, others by role."""
    every = KeyExpressions.of_every_robot(site)
    roles = {
        "viewer": _served(_watching(every, "viewer"), "ingress", "egress"),
        "station": _served(_commanding(every, "station"), "ingress", "egress"),
    }
    rules, subjects, policies = [], [], []
    for role, own in roles.items():
        names = sorted({f"{role}:{holder.name}" for holder in holders if holder.role == role})
        if names:
            rules += own
            subjects.append({"id": role, "cert_common_names": names})
            policies.append({"rules": _ids(own), "subjects": [role]})
    for name in sorted({holder.name for holder in holders if holder.role == "robot"}):
        keys = KeyExpressions(name, site)
        own = [
            *_served(_commanding(keys, f"robot {name}"), "egress", "ingress"),
            *_served(_looking_for_twins(keys, "twin of"), "ingress", "egress"),
            *_served(_looking_for_twins(keys, "robot as twin"), "egress", "ingress"),
        ]
        rules += own
        subjects.append({"id": f"robot {name}", "cert_common_names": [f"robot:{name}"]})
        policies.append({"rules": _ids(own), "subjects": [f"robot {name}"]})
    return _control(rules, subjects, policies)


def _watching(keys: KeyExpressions, name: str) -> Flow:
    return Flow(
        f"{name} watch",
        asked=(
            keys.info,
            keys.keep,
            keys.log,
            keys.poses,
            keys.record,
            keys.mission("*", "part/*"),
            keys.mavlink("hello"),
        ),
        told=(f"{keys.root}/tel/*", keys.mavlink("down")),
        shown=(keys.alive, keys.mavlink("alive")),
        signed_in=(keys.watcher("*"),),
    )


def _commanding(keys: KeyExpressions, name: str) -> Flow:
    watching = _watching(keys, name)
    orders = (keys.command("*"), keys.mission("*", "**"))
    return Flow(
        f"{name} command",
        asked=(*watching.asked, *orders),
        told=watching.told,
        said=(keys.mavlink("up"),),
        shown=watching.shown,
        signed_in=watching.signed_in,
    )


def _everything(keys: KeyExpressions) -> Flow:
    """Return all messages of one robot, and the tokens of all robots."""
    every, own = KeyExpressions.of_every_robot(keys.site), _commanding(keys, "holder")
    return replace(own, asked=(*own.asked, keys.boot), shown=(*own.shown, every.alive))


def _own_tunnel(keys: KeyExpressions) -> Flow:
    return Flow(
        "own tunnel",
        asked=(keys.mavlink("hello"),),
        told=(keys.mavlink("down"),),
        said=(keys.mavlink("up"),),
        shown=(keys.mavlink("alive"),),
    )


def _looking_for_twins(keys: KeyExpressions, name: str) -> Flow:
    return Flow(f"{name} {keys.robot}", asked=(keys.boot,), shown=(keys.alive,))


def _served(flow: Flow, inward: str, outward: str) -> list[dict[str, Any]]:
    """Return rules for a flow: questions go `inward`, answers and publications `outward`."""
    rules = (
        _rule(f"{flow.name} ask", ["query"], inward, flow.asked),
        _rule(f"{flow.name} answer", ["reply", "declare_queryable"], outward, flow.asked),
        _rule(f"{flow.name} tell", ["put"], outward, flow.told),
        _rule(f"{flow.name} listen", ["declare_subscriber"], inward, flow.told),
        _rule(f"{flow.name} say", ["put"], inward, flow.said),
        _rule(f"{flow.name} hear", ["declare_subscriber"], outward, flow.said),
        _rule(f"{flow.name} show", ["liveliness_token"], outward, flow.shown),
        _rule(f"{flow.name} look", [*LOOKING], inward, flow.shown),
        _rule(f"{flow.name} sign in", ["liveliness_token"], inward, flow.signed_in),
        _rule(f"{flow.name} look for", [*LOOKING], outward, flow.signed_in),
    )
    return [rule for rule in rules if rule["key_exprs"]]


def _rule(name: str, messages: list[str], flow: str, keys: tuple[str, ...]) -> dict[str, Any]:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": list(keys)}


def _control(
    rules: list[dict[str, Any]], subjects: list[dict[str, Any]], policies: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects,
        "policies": policies,
    }  # fmt: skip


def _ids(rules: list[dict[str, Any]]) -> list[str]:
    return [rule["id"] for rule in rules]

"""Who may do what on a robot's keys: nothing, unless a rule here says so.

zenoh applies this at the robot, by the role that stands in the certificate of the link. A rule lets a message
pass only if it includes the message's whole key. What is denied looks to the other end like no answer.
"""

from __future__ import annotations

from typing import Any

from bridge.link.protocol import KeyExpressions


def access_control(keys: KeyExpressions) -> dict[str, Any]:
    """zenoh's `access_control` for one robot: default deny, viewers watch, stations command as well.

    A router in between holds a robot's certificate and passes on what stations ask; there the
    signatures of orders and missions tell who asks. Raw MAVLink frames carry no such signature, so they are
    taken towards the vehicle from a station's own link only.
    """
    looking = [*_watching(keys), *_overhearing(keys)]
    roles = {
        "viewer": looking,
        "station": [*looking, *_commanding(keys), *_steering(keys)],
        "robot": [*looking, *_commanding(keys), *_tunnelling(keys)],
    }
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*looking, *_commanding(keys), *_steering(keys), *_tunnelling(keys)],
        "subjects": [{"id": role, "cert_common_names": [role]} for role in roles],
        "policies": [{"rules": _ids(rules), "subjects": [role]} for role, rules in roles.items()],
    }


def _watching(keys: KeyExpressions) -> list[dict[str, Any]]:
    every = KeyExpressions.of_every_robot(keys.site)
    asked = [every.info, keys.log, keys.poses, keys.mission("*", "part/*")]
    told = [f"{keys.root}/tel/*"]
    tokens = [every.alive]
    watchers = [keys.watcher("*")]
    return [
        _rule("watch_ask", ["query"], "ingress", asked),
        _rule("watch_answer", ["reply", "declare_queryable"], "egress", asked),
        _rule("watch_told", ["put"], "egress", told),
        _rule("watch_listen", ["declare_subscriber"], "ingress", told),
        _rule("watch_alive", ["liveliness_token"], "egress", tokens),
        _rule("watch_look", ["declare_liveliness_subscriber", "liveliness_query"], "ingress", tokens),
        _rule("watch_show", ["liveliness_token"], "ingress", watchers),
        _rule("watch_seen", ["declare_liveliness_subscriber", "liveliness_query"], "egress", watchers),
    ]


def _commanding(keys: KeyExpressions) -> list[dict[str, Any]]:
    orders = [keys.command("*"), keys.mission("*", "**")]
    return [
        _rule("command_ask", ["query"], "ingress", orders),
        _rule("command_answer", ["reply", "declare_queryable"], "egress", orders),
    ]


def _overhearing(keys: KeyExpressions) -> list[dict[str, Any]]:
    """Frames from the vehicle."""
    down, alive, hello = [keys.mavlink("down")], [keys.mavlink("alive")], [keys.mavlink("hello")]
    return [
        _rule("mavlink_greet", ["query"], "ingress", hello),
        _rule("mavlink_greeted", ["reply", "declare_queryable"], "egress", hello),
        _rule("mavlink_told", ["put"], "egress", down),
        _rule("mavlink_listen", ["declare_subscriber"], "ingress", down),
        _rule("mavlink_alive", ["liveliness_token"], "egress", alive),
        _rule("mavlink_look", ["declare_liveliness_subscriber", "liveliness_query"], "ingress", alive),
    ]


def _steering(keys: KeyExpressions) -> list[dict[str, Any]]:
    """Frames to the vehicle."""
    up = [keys.mavlink("up")]
    return [
        _rule("mavlink_say", ["put"], "ingress", up),
        _rule("mavlink_hear", ["declare_subscriber"], "egress", up),
    ]


def _tunnelling(keys: KeyExpressions) -> list[dict[str, Any]]:
    """The tunnel's end at the robot, if it is a process of its own that joins the robot's."""
    down, up, alive = [keys.mavlink("down")], [keys.mavlink("up")], [keys.mavlink("alive")]
    hello = [keys.mavlink("hello")]
    return [
        _rule("tunnel_greeted", ["query"], "egress", hello),
        _rule("tunnel_greets", ["reply", "declare_queryable"], "ingress", hello),
        _rule("tunnel_tell", ["put"], "ingress", down),
        _rule("tunnel_wanted", ["declare_subscriber"], "egress", down),
        _rule("tunnel_told", ["put"], "egress", up),
        _rule("tunnel_listen", ["declare_subscriber"], "ingress", up),
        _rule("tunnel_alive", ["liveliness_token"], "ingress", alive),
        _rule("tunnel_seen", ["declare_liveliness_subscriber", "liveliness_query"], "egress", alive),
    ]


def _rule(name: str, messages: list[str], flow: str, keys: list[str]) -> dict[str, Any]:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": keys}


def _ids(rules: list[dict[str, Any]]) -> list[str]:
    return [rule["id"] for rule in rules]

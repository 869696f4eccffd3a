"""Who may do what on a robot's keys: nothing, unless a rule here says so.

zenoh applies this at the robot, by the role that stands in the certificate of the link. A rule lets a message
pass only if it includes the message's whole key. What is denied looks to the other end like no answer.
"""

from __future__ import annotations

from typing import Any

from bridge.protocol import Keys


def access_control(keys: Keys) -> dict[str, Any]:
    """zenoh's `access_control` for one robot: default deny, viewers watch, stations command as well.

    A router in between holds a robot's certificate and passes on what stations ask; there the
    signatures of orders and missions tell who asks.
    """
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*_watching(keys), *_commanding(keys)],
        "subjects": [{"id": role, "cert_common_names": [role]} for role in ("viewer", "station", "robot")],
        "policies": [
            {"rules": _ids(_watching(keys)), "subjects": ["viewer"]},
            {"rules": _ids([*_watching(keys), *_commanding(keys)]), "subjects": ["station", "robot"]},
        ],
    }


def _watching(keys: Keys) -> list[dict[str, Any]]:
    every = Keys("*", keys.site)
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


def _commanding(keys: Keys) -> list[dict[str, Any]]:
    orders = [keys.command("*"), keys.mission("*", "**")]
    return [
        _rule("command_ask", ["query"], "ingress", orders),
        _rule("command_answer", ["reply", "declare_queryable"], "egress", orders),
    ]


def _rule(name: str, messages: list[str], flow: str, keys: list[str]) -> dict[str, Any]:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": keys}


def _ids(rules: list[dict[str, Any]]) -> list[str]:
    return [rule["id"] for rule in rules]

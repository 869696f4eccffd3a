"""The graph of a ROS 2 network over zenoh as it is now, and the tokens by which others see a node of ours."""

from __future__ import annotations

import itertools
import threading
from typing import Any

import zenoh

from stopgo.bridge.ros2.ros_graph import KINDS, TOKENS, EntityKind, RosEntity, entity_of
from stopgo.bridge.ros2.ros_port import RosQuality

LETTERS = {kind: letters for letters, kind in KINDS.items()}
RELIABILITY = {"best effort": "2", "reliable": "", "kept": ""}
DURABILITY = {"best effort": "", "reliable": "", "kept": "1"}
"""Numbers of QoS policies in a token; empty for the default."""


class LiveGraph:
    """Entities of one domain, kept up to date by zenoh's liveliness."""

    def __init__(self, session: Any, domain: int) -> None:
        self._lock = threading.Lock()
        self._known: dict[tuple[EntityKind, str], dict[str, RosEntity]] = {}
        self._subscriber = session.liveliness().declare_subscriber(
            f"{TOKENS}/{domain}/**", self._heard, history=True
        )

    def _heard(self, sample: Any) -> None:
        token = str(sample.key_expr)
        one = entity_of(token)
        if one is None:
            return
        with self._lock:
            of_name = self._known.setdefault((one.kind, one.name), {})
            if sample.kind == zenoh.SampleKind.PUT:
                of_name[token] = one
            else:
                of_name.pop(token, None)

    def of(self, kind: EntityKind, name: str) -> tuple[RosEntity, ...]:
        """Return what publishes, subscribes or serves a name at present."""
        with self._lock:
            return tuple(self._known.get((kind, name), {}).values())

    def names_of(self, kind: EntityKind, type_: str) -> list[str]:
        """Return the names with a type, sorted."""
        with self._lock:
            entities = [one for known in self._known.values() for one in known.values()]
        return sorted({one.name for one in entities if one.kind == kind and one.type == type_})


class NodeTokens:
    """Liveliness tokens of one node, as rmw_zenoh declares them."""

    def __init__(self, session: Any, domain: int, namespace: str, node: str) -> None:
        self._session = session
        self._domain = domain
        self._owner = f"%/{namespace.replace('/', '%')}/{node}"
        self._numbers = itertools.count(1)
        self._held = dict([self._declared(0, "node", "")])

    def _declared(self, number: int, kind: EntityKind, tail: str) -> tuple[str, Any]:
        zid = self._session.zid()
        text = f"{TOKENS}/{self._domain}/{zid}/0/{number}/{LETTERS[kind]}/{self._owner}{tail}"
        return text, self._session.liveliness().declare_token(text)

    def declare(
        self,
        kind: EntityKind,
        name: str,
        type_: str,
        hash_: str,
        quality: RosQuality = "reliable",
        depth: int = 10,
    ) -> str:
        """Declare an entity; return its token."""
        package, group, bare = type_.split("/")
        qos = f"{RELIABILITY[quality]}:{DURABILITY[quality]}:,{depth}:,:,:,,"
        tail = f"/{name.replace('/', '%')}/{package}::{group}::dds_::{bare}_/{hash_}/{qos}"
        text, token = self._declared(next(self._numbers), kind, tail)
        self._held[text] = token
        return text

    def withdraw(self, token: str) -> None:
        """End a token that was declared here."""
        self._held.pop(token).undeclare()

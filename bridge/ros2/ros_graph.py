"""The graph of a ROS 2 network over zenoh: who publishes, subscribes and serves, from liveliness tokens.

A token of rmw_zenoh names domain, session, node, kind, namespace, name, type, hash of the type's definition,
and QoS. A token of zenoh-bridge-ros2dds names its session, kind, key, type and QoS; it knows no node.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

TOKENS = "@ros2_lv"
BRIDGED_TOKENS = f"@/*/{TOKENS}"
"""Those of zenoh-bridge-ros2dds."""
ACTION = "/_action/send_goal"
EntityKind = Literal["node", "publisher", "subscriber", "server", "client"]
KINDS: dict[str, EntityKind] = {
    "NN": "node",
    "MP": "publisher",
    "MS": "subscriber",
    "SS": "server",
    "SC": "client",
}
BRIDGED_ACTIONS: dict[str, EntityKind] = {"AS": "server", "AC": "client"}


@dataclass(frozen=True)
class RosEntity:
    """A node, or what it publishes, subscribes or serves."""

    domain: int | None
    """`None` behind zenoh-bridge-ros2dds."""
    kind: EntityKind
    node: str
    """With its namespace, such as /r1/nav2; the bridge's, where only that is known."""
    name: str = ""
    """With its namespace, such as /r1/odom."""
    type: str = ""
    """As ROS users write it: nav_msgs/msg/Odometry."""
    hash: str = ""
    qos: str = ""
    source: str = ""
    """Session and numbers of the entity: another one after a restart."""

    @property
    def key(self) -> str:
        """Key expression of its data."""
        if self.domain is None:
            return self.name.strip("/")
        package, group, kind = self.type.split("/")
        return f"{self.domain}/{self.name.strip('/')}/{package}::{group}::dds_::{kind}_/{self.hash}"

    @property
    def reliable(self) -> bool:
        return self._policy(0) != "2"

    @property
    def kept(self) -> bool:
        """True if late subscribers get what was published before."""
        return self._policy(1) == "1"

    def _policy(self, place: int) -> str:
        parts = self.qos.split(":")
        return parts[place] if len(parts) > place else ""


def entity_of(token: str) -> RosEntity | None:
    """Return what a liveliness token says; `None` if it is no token of a ROS 2 network."""
    parts = token.split("/")
    if parts[0] == "@":
        return _bridged(parts)
    if len(parts) < 9 or parts[0] != TOKENS or parts[5] not in KINDS or not parts[1].isdigit():
        return None
    kind, source = KINDS[parts[5]], "/".join(parts[2:5])
    node = f"{_name(parts[7]).rstrip('/')}/{parts[8]}"
    if kind == "node":
        return RosEntity(int(parts[1]), kind, node, source=source)
    if len(parts) < 13:
        return None
    type_ = parts[10].replace("::dds_::", "::").removesuffix("_").replace("::", "/")
    if type_.count("/") != 2:
        return None
    return RosEntity(int(parts[1]), kind, node, _name(parts[9]), type_, parts[11], parts[12], source)


def _bridged(parts: list[str]) -> RosEntity | None:
    """Return what a token of zenoh-bridge-ros2dds says, in its parts."""
    if len(parts) < 6 or parts[2] != TOKENS:
        return None
    of, name, type_ = parts[3], "/" + parts[4].replace("§", "/"), parts[5].replace("§", "/")
    node = f"zenoh-bridge-ros2dds {parts[1][:8]}"
    if of in BRIDGED_ACTIONS:
        return RosEntity(None, BRIDGED_ACTIONS[of], node, f"{name}{ACTION}", f"{type_}_SendGoal")
    if of not in KINDS or type_.count("/") != 2:
        return None
    policies = parts[6].split(":") if len(parts) > 6 else []
    _, reliability, durability, _, told, *_ = [*policies, *[""] * 5]
    qos = f"{'2' if reliability == '0' else '1'}:{'1' if durability == '1' else '2'}"
    return RosEntity(
        None, KINDS[of], node, name, type_, told.partition("typehash=")[2].partition(";")[0], qos
    )


def _name(mangled: str) -> str:
    """Return a name with its slashes; `%` stands for one."""
    return "/" + mangled.replace("%", "/").strip("/")


def actions_of(entities: Iterable[RosEntity]) -> dict[str, str]:
    """Return the actions that are served, by name, with their types."""
    served = (one for one in entities if one.kind == "server" and one.name.endswith(ACTION))
    return {one.name.removesuffix(ACTION): one.type.removesuffix("_SendGoal") for one in served}


def discords(entities: Iterable[RosEntity]) -> Iterator[str]:
    """Yield pairs that do not hear each other: other types, other definitions, or QoS that does not fit."""
    known = list(entities)
    givers = [one for one in known if one.kind in ("publisher", "server")]
    takers = [one for one in known if one.kind in ("subscriber", "client")]
    for giver in givers:
        for taker in takers:
            if taker.name == giver.name and (taker.kind == "client") == (giver.kind == "server"):
                why = _discord(giver, taker)
                if why:
                    yield f"{giver.name}: {giver.node} and {taker.node} do not fit: {why}"


def _discord(giver: RosEntity, taker: RosEntity) -> str:
    if giver.type != taker.type:
        return f"types {giver.type} and {taker.type}"
    if giver.hash and taker.hash and giver.hash != taker.hash:
        return hash_text(giver.type, giver.hash, taker.hash)
    if giver.kind == "server":
        return ""
    if taker.reliable and not giver.reliable:
        return "best effort is published, reliable is subscribed"
    return "volatile is published, transient local is subscribed" if taker.kept and not giver.kept else ""


def hash_text(kind: str, there: str, here: str) -> str:
    """Return two definitions of one type in words."""
    return f"two versions of {kind}: {there} and {here}"

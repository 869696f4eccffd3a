"""CDR and hashes of types by real ROS: Fast CDR, and what rosidl has written beside the types."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from stopgo.bridge.ros2.rclpy_node import ClassKind, loaded_type

IN_ACTION = {
    "SendGoal_Request": "SendGoalService.Request",
    "SendGoal_Response": "SendGoalService.Response",
    "GetResult_Request": "GetResultService.Request",
    "GetResult_Response": "GetResultService.Response",
}


@cache
def class_of(kind: str) -> Any:
    """The class of a type, also of a request or response."""
    package, group, name = kind.split("/")
    for suffix, where in IN_ACTION.items():
        if group == "action" and name.endswith(f"_{suffix}"):
            outer, inner = where.split(".")
            action = loaded_type(f"{package}/action/{name.removesuffix(f'_{suffix}')}")
            return getattr(getattr(action.Impl, outer), inner)
    if group == "srv" and "_" in name:
        service, _, part = name.rpartition("_")
        return getattr(loaded_type(f"{package}/srv/{service}"), part)
    return loaded_type(kind)


class RealCodec:
    def hash(self, kind: str) -> str:
        package, group, name = kind.split("/")
        for prefix in os.environ["AMENT_PREFIX_PATH"].split(":"):
            file = Path(prefix) / "share" / package / group / f"{name.partition('_')[0]}.json"
            if file.exists():
                for one in json.loads(file.read_text())["type_hashes"]:
                    if one["type_name"] == kind:
                        return str(one["hash_string"])
        raise AssertionError(kind)

    def encode(self, kind: str, fields: Mapping[str, Any]) -> bytes:
        return bytes(serialize_message(ClassKind(class_of(kind)).message(fields)))

    def decode(self, kind: str, data: bytes) -> Any:
        return deserialize_message(data, class_of(kind))

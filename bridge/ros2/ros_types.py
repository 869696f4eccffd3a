"""Fields of ROS messages as plain values: nested mappings and lists, whichever library makes the messages."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

from stopgo.bridge.ros2.ros_settings import ScanCall
from stopgo.mission.errors import InputError

RosFields = Mapping[str, Any]
"""Values of a message's fields, by name; inner messages are mappings. What is missing has its default."""


class MessageKind(Protocol):
    """A type of message."""

    @property
    def name(self) -> str: ...

    @property
    def fields(self) -> Mapping[str, str]:
        """Type of each field, as rosidl writes it: `double`, `sequence<uint8>`, `std_msgs/Header`."""

    def inner(self, field: str) -> MessageKind:
        """Return the type of a field that is a message, or a list of messages."""

    def message(self, fields: RosFields) -> Any:
        """Return a message with these fields."""


def check_scan(scan: ScanCall, request: MessageKind, response: MessageKind) -> None:
    """Check the fields that a scan's settings name.

    Raises
    ------
    InputError
        Naming the missing field, and those that there are.
    """
    checked_fields(request, {field: _example(value) for field, value in scan.request.items()})
    for key in ("success", "message", "file", "size", "sha256", "points"):
        first = getattr(scan, key).partition(".")[0]
        if first and first not in response.fields:
            raise InputError(
                f"scan.{key} = {getattr(scan, key)!r}: the response of {scan.type} has no field {first};"
                f" it has: {', '.join(response.fields) or 'none'}"
            )


EXAMPLES = {"{duration_s}": 1.0, "{timeout_s}": 1.0}
"""Values of the type that a request will have in these places."""


def _example(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _example(inner) for key, inner in value.items()}
    return EXAMPLES.get(value, value) if isinstance(value, str) else value


def checked_fields(kind: MessageKind, fields: RosFields, where: str = "scan.request") -> dict[str, Any]:
    """Return the fields as their types take them; raises `InputError` for a wrong field or value."""
    checked: dict[str, Any] = {}
    for field, given in fields.items():
        if field not in kind.fields:
            raise InputError(
                f"{where}.{field}: {kind.name} has no such field; it has: {', '.join(kind.fields) or 'none'}"
            )
        type_ = kind.fields[field]
        if isinstance(given, Mapping) and "/" in type_:
            checked[field] = checked_fields(kind.inner(field), given, f"{where}.{field}")
            continue
        value = _as_type(given, type_)
        if not _fits(value, type_):
            raise InputError(f"{where}.{field} = {given!r}: must be {type_}")
        checked[field] = value
    return checked


def _fits(value: Any, kind: str) -> bool:
    """Return True if a field of this type takes the value; lists and messages are not looked at."""
    wanted = {"boolean": bool, "string": str, "float": float, "double": float}.get(kind)
    if wanted is not None:
        return isinstance(value, wanted)
    whole = kind.startswith(("int", "uint")) and "[" not in kind
    return not whole or (isinstance(value, int) and not isinstance(value, bool))


def _as_type(value: Any, kind: str) -> Any:
    """Return a number as a field of this type takes it; anything else as it is."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return value
    if kind in ("float", "double"):
        return float(value)
    return int(value) if "int" in kind and float(value).is_integer() else value


def plain_fields(message: Any) -> dict[str, Any]:
    """Return a message's fields as plain values, inner messages as dictionaries."""
    if dataclasses.is_dataclass(message):
        names = [one.name for one in dataclasses.fields(message) if not one.name.startswith("__")]
    else:
        names = list(message.get_fields_and_field_types())
    return {name: _plain(getattr(message, name)) for name in names}


def _plain(value: Any) -> Any:
    is_message = hasattr(value, "get_fields_and_field_types") or dataclasses.is_dataclass(value)
    return plain_fields(value) if is_message else value

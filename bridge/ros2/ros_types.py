"""Types of ROS messages, services and actions, loaded by their names, and their fields as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from stopgo.bridge.ros2.ros_settings import ScanCall
from stopgo.mission.errors import InputError, MissingExtra

RosFields = Mapping[str, Any]


def load(module: str) -> Any:
    """Load a module of ROS; raises `MissingExtra` if ROS's Python packages are not there."""
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtra(
            f"--controller ros2: no Python module {module} ({error});"
            " run `source /opt/ros/jazzy/setup.bash` first, and start stopgo with ROS's Python"
        ) from None


def checked_scan_type(scan: ScanCall) -> Any:
    """Return the type of the scanner's service or action, after a check of the fields that scan names.

    Raises
    ------
    InputError
        Naming the missing field, and those that there are.
    """
    package, kind, name = scan.type.split("/")
    try:
        found = getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise InputError(f"scan.type = {scan.type!r}: there is no such type here ({error})") from None
    request, response = (found.Goal, found.Result) if kind == "action" else (found.Request, found.Response)
    filled_message(request, {field: _example(value) for field, value in scan.request.items()})
    known = response.get_fields_and_field_types()
    for key in ("success", "message", "file", "size", "sha256", "points"):
        first = getattr(scan, key).partition(".")[0]
        if first and first not in known:
            raise InputError(
                f"scan.{key} = {getattr(scan, key)!r}: the response of {scan.type} has no field {first};"
                f" it has: {', '.join(known) or 'none'}"
            )
    return found


EXAMPLES = {"{duration_s}": 1.0, "{timeout_s}": 1.0}
"""Values of the type that a request will have in these places."""


def _example(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _example(inner) for key, inner in value.items()}
    return EXAMPLES.get(value, value) if isinstance(value, str) else value


def filled_message(kind: Any, fields: RosFields, where: str = "scan.request") -> Any:
    """Return a message with these fields; raises `InputError` for a wrong field or value."""
    made, known = kind(), kind.get_fields_and_field_types()
    for field, given in fields.items():
        if field not in known:
            raise InputError(
                f"{where}.{field}: {kind.__name__} has no such field; it has: {', '.join(known) or 'none'}"
            )
        if isinstance(given, Mapping):
            value = filled_message(type(getattr(made, field)), given, f"{where}.{field}")
        else:
            value = _as_type(given, known[field])
        if not _fits(value, known[field]):
            raise InputError(f"{where}.{field} = {given!r}: must be {known[field]}")
        setattr(made, field, value)
    return made


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
    return {name: _plain(getattr(message, name)) for name in message.get_fields_and_field_types()}


def _plain(value: Any) -> Any:
    return plain_fields(value) if hasattr(value, "get_fields_and_field_types") else value

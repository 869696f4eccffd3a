"""Fields of a scanner's request, with a type that is made here: no ROS is needed."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from stopgo.bridge.ros2.rclpy_node import ClassKind, RclpyNode
from stopgo.bridge.ros2.ros_settings import ScanCall
from stopgo.bridge.ros2.ros_types import check_scan, checked_fields, plain_fields
from stopgo.mission.errors import InputError


class Request:
    """As a message class of rclpy."""

    TYPES: ClassVar[dict[str, str]] = {
        "label": "string",
        "seconds": "uint8",
        "loud": "boolean",
        "far": "double",
    }

    def __init__(self) -> None:
        self.label, self.seconds, self.loud, self.far = "", 0, False, 0.0

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return cls.TYPES


def test_numbers_are_given_as_the_field_takes_them() -> None:
    kind = ClassKind(Request)
    made = kind.message(checked_fields(kind, {"label": "a", "seconds": 60.0, "loud": True, "far": 3}))
    assert plain_fields(made) == {"label": "a", "seconds": 60, "loud": True, "far": 3.0}
    assert isinstance(made.seconds, int) and isinstance(made.far, float)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"name": "a"}, "scan.request.name: Request has no such field; it has: label, seconds, loud, far"),
        ({"label": 3}, "scan.request.label = 3: must be string"),
        ({"seconds": "long"}, "scan.request.seconds = 'long': must be uint8"),
        ({"seconds": 1.5}, "scan.request.seconds = 1.5: must be uint8"),
        ({"loud": "yes"}, "scan.request.loud = 'yes': must be boolean"),
    ],
)
def test_a_wrong_field_is_named_with_what_there_is(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as told:
        checked_fields(ClassKind(Request), fields)
    assert str(told.value) == words


def test_a_response_without_a_named_field_is_refused() -> None:
    kind = ClassKind(Request)
    with pytest.raises(InputError) as told:
        check_scan(ScanCall(success="ok"), kind, kind)
    words = "scan.success = 'ok': the response of std_srvs/srv/Trigger has no field ok; it has: label, "
    assert str(told.value) == f"{words}seconds, loud, far"


def test_a_type_that_is_not_installed_is_named() -> None:
    class Node:
        def get_name(self) -> str:
            return "stopgo"

        get_namespace = get_name

    with pytest.raises(InputError, match="there is no such type here"):
        RclpyNode(Node()).service_kinds("foo_msgs/srv/Scan")

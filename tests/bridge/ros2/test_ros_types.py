"""Fields of a scanner's request, with a type that is made here: no ROS is needed."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from stopgo.bridge.ros2.ros_settings import ScanCall
from stopgo.bridge.ros2.ros_types import checked_scan_type, filled_message, plain_fields
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
    made = filled_message(Request, {"label": "a", "seconds": 60.0, "loud": True, "far": 3})
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
        filled_message(Request, fields)
    assert str(told.value) == words


def test_a_type_that_is_not_installed_is_named() -> None:
    with pytest.raises(InputError, match="there is no such type here"):
        checked_scan_type(ScanCall(type="foo_msgs/srv/Scan"))

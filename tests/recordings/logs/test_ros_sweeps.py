"""Point clouds of ROS, however their bytes are laid out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stopgo.recordings.logs.ros_sweeps import SWEEPS

POINTS = np.array([(1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0), (np.nan, 0.0, 0.0)])


def cloud(
    xyz: np.ndarray,
    *,
    order: str = "<",
    form: str = "f4",
    pad: int = 4,
    height: int = 1,
    row_pad: int = 0,
    **told: Any,
) -> Any:
    """A PointCloud2 with its own padding between points and rows."""
    size = np.dtype(form).itemsize
    step = 3 * size + pad
    kind = np.dtype({
        "names": ["x", "y", "z"], "formats": [order + form] * 3,
        "offsets": [0, size, 2 * size], "itemsize": step,
    })  # fmt: skip
    rows = np.zeros(len(xyz), kind)
    for number, name in enumerate("xyz"):
        rows[name] = xyz[:, number]
    width = len(xyz) // height
    data = b"".join(rows[k * width : (k + 1) * width].tobytes() + b"\7" * row_pad for k in range(height))
    number = {"f4": 7, "f8": 8}[form]
    fields = [SimpleNamespace(name=name, offset=k * size, datatype=number) for k, name in enumerate("xyz")]
    given: dict[str, Any] = {
        "height": height, "width": width, "fields": fields, "is_bigendian": order == ">",
        "point_step": step, "row_step": width * step + row_pad, "data": np.frombuffer(data, np.uint8),
    }  # fmt: skip
    return SimpleNamespace(**(given | told))


def points(message: Any) -> np.ndarray:
    return SWEEPS["sensor_msgs/msg/PointCloud2"](message)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("form", ["f4", "f8"])
@pytest.mark.parametrize(("height", "row_pad"), [(1, 0), (2, 0), (2, 5), (4, 16)])
def test_every_layout_gives_the_same_points(order: str, form: str, height: int, row_pad: int) -> None:
    found = points(cloud(POINTS, order=order, form=form, height=height, row_pad=row_pad))
    assert np.array_equal(found, POINTS[:3])


@pytest.mark.parametrize("told", [{"point_step": 0}, {"point_step": 8}, {"fields": []}])
def test_a_cloud_that_contradicts_itself_shows_nothing(told: dict[str, Any]) -> None:
    assert points(cloud(POINTS, **told)).shape == (0, 3)


def test_a_cloud_that_is_cut_off_shows_its_whole_points() -> None:
    message = cloud(POINTS, height=2)
    message.data = message.data[: 2 * message.point_step + 3]
    assert np.array_equal(points(message), POINTS[:2])

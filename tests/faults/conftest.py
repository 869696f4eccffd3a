"""Worlds of the fault tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.own_time import World, stepped_into


@pytest.fixture
def world() -> Iterator[World]:
    """Time of the test's own."""
    with stepped_into() as stepped:
        yield stepped

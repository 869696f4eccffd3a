"""Python's own Zstandard is used where rosbags installs none."""

from __future__ import annotations

import runpy
import sys
from types import ModuleType

import pytest

from stopgo.recordings.logs import zstandard


def test_from_3_14_on_it_is_of_python_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    own = ModuleType("compression")
    monkeypatch.setattr(own, "zstd", ModuleType("compression.zstd"), raising=False)
    monkeypatch.setitem(sys.modules, "compression", own)
    monkeypatch.setattr(sys, "version_info", (3, 14, 0))
    assert zstandard.__file__ is not None
    assert runpy.run_path(zstandard.__file__)["zstd"] is own.zstd

"""A spared module is loaded by its first use, and is then the module itself."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from stopgo.spared_modules import SPARED, load_when_used


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a package with the modules `heavy`, which notes that it was loaded, and `light`."""
    name = "package_with_a_heavy_module"
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("loaded = []\n")
    (tmp_path / name / "heavy.py").write_text(f"import {name}\n{name}.loaded.append(__name__)\nanswer = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    for part in (name, f"{name}.heavy"):
        monkeypatch.delitem(sys.modules, part, raising=False)
    return name


def test_a_spared_module_is_loaded_at_its_first_use(package: str) -> None:
    load_when_used([f"{package}.heavy"])
    whole = import_module(package)
    heavy = whole.heavy
    assert whole.loaded == []
    assert heavy.answer == 42
    assert whole.loaded == [f"{package}.heavy"]
    assert import_module(f"{package}.heavy") is heavy


def test_a_loaded_or_a_missing_module_stays_as_it_is(package: str) -> None:
    heavy = import_module(f"{package}.heavy")
    load_when_used([f"{package}.heavy", f"{package}.missing"])
    assert sys.modules[f"{package}.heavy"] is heavy
    assert f"{package}.missing" not in sys.modules


def test_the_spared_modules_of_numpy_work_once_they_are_used() -> None:
    load_when_used()
    assert set(SPARED) <= set(sys.modules)
    assert np.ma.array([1, 2], mask=[True, False]).sum() == 2
    assert np.random.default_rng(1).random() == np.random.default_rng(1).random()
    np.testing.assert_equal(1, 1)

"""A spared module is loaded by its first use, and is then the module itself."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from stopgo.spared_modules import GATHERING, STAND_INS, gather_when_used, load_when_used


@pytest.fixture(autouse=True)
def finders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))


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
    whole, heavy = import_module(package), import_module(f"{package}.heavy")
    assert whole.loaded == []
    assert heavy.answer == 42
    assert whole.loaded == [f"{package}.heavy"]
    assert import_module(f"{package}.heavy") is heavy


def test_a_loaded_or_a_missing_module_stays_as_it_is(package: str) -> None:
    heavy = import_module(f"{package}.heavy")
    load_when_used([f"{package}.heavy", f"{package}.missing"])
    assert import_module(f"{package}.heavy") is heavy
    with pytest.raises(ModuleNotFoundError):
        import_module(f"{package}.missing")


@pytest.mark.parametrize("use", ["heavy.answer()", "from_heavy()", "heavy.other", "from_heavy.__name__"])
def test_a_stand_in_loads_its_module_when_it_is_used(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use: str
) -> None:
    text = f"import {package}\n{package}.loaded.append(__name__)\ndef answer(): return 42\nother = 43\n"
    (tmp_path / package / "heavy.py").write_text(text)
    monkeypatch.setitem(STAND_INS, f"{package}.heavy", "answer")
    load_when_used()
    heavy = import_module(f"{package}.heavy")
    from_heavy = heavy.answer
    assert import_module(package).loaded == []
    found = eval(use, {"heavy": heavy, "from_heavy": from_heavy})
    assert found == {"heavy.other": 43, "from_heavy.__name__": "answer"}.get(use, 42)
    assert import_module(package).loaded == [f"{package}.heavy"]
    assert from_heavy() == heavy.answer() == 42
    assert import_module(package).loaded == [f"{package}.heavy"]


def test_a_gathering_package_loads_a_module_for_its_name(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "from .heavy import (\n    answer as answer,\n)\nfrom .light import other\nloaded = []\n"
    (tmp_path / package / "__init__.py").write_text(text)
    (tmp_path / package / "heavy.py").write_text("def answer(): return 42\n")
    (tmp_path / package / "light.py").write_text("other = 43\n")
    for stand_ins in (False, True):
        for part in ("", ".heavy", ".light"):
            monkeypatch.delitem(sys.modules, f"{package}{part}", raising=False)
        monkeypatch.setitem(GATHERING, package, stand_ins)
        gather_when_used()
        whole = import_module(package)
        answer = whole.answer
        assert (f"{package}.heavy" in sys.modules) is not stand_ins
        assert answer() == 42
        assert f"{package}.heavy" in sys.modules and f"{package}.light" not in sys.modules
        with pytest.raises(AttributeError):
            _ = whole.missing


GATHERED = """
import json, sys
from importlib import import_module
from stopgo.spared_modules import SPARED_OF_RERUN, gather_when_used, load_when_used
load_when_used(SPARED_OF_RERUN)
gather_when_used()
import stopgo.recordings.plan
assert sum(name.startswith("rerun.") for name in sys.modules) < 300, "the others are spared"
for package, names in json.load(sys.stdin).items():
    found = {name: getattr(import_module(package), name).__name__ for name in names}
    assert found == names, package
"""


def test_the_gathering_packages_of_rerun_have_all_their_names() -> None:
    names = {
        package: {
            name: value.__name__
            for name, value in vars(import_module(package)).items()
            if isinstance(value, type)
        }
        for package in GATHERING
    }
    assert all(len(found) > 10 for found in names.values())
    subprocess.run([sys.executable, "-c", GATHERED], input=json.dumps(names), text=True, check=True)


USED = """
import sys
from stopgo.spared_modules import load_when_used
load_when_used()
import ezdxf, numpy, scipy.sparse.csgraph
assert not {"pyparsing.core", "scipy.linalg"} & set(sys.modules), "spared"
drawing = ezdxf.new()
drawing.modelspace().add_line((0, 0), (1, 1))
assert len(drawing.query("LINE")) == 1
graph = numpy.array([[0, 1], [1, 0]])
assert scipy.sparse.csgraph.laplacian(graph).tolist() == [[1, -1], [-1, 1]]
import pyparsing
assert issubclass(pyparsing.ParseException, Exception)
"""


def test_the_stand_ins_of_libraries_work_once_they_are_used() -> None:
    subprocess.run([sys.executable, "-c", USED], check=True)


def test_the_spared_modules_of_numpy_work_once_they_are_used() -> None:
    load_when_used()
    assert np.ma.array([1, 2], mask=[True, False]).sum() == 2
    assert np.random.default_rng(1).random() == np.random.default_rng(1).random()
    np.testing.assert_equal(1, 1)


def test_recordings_load_without_some_modules_of_rerun() -> None:
    program = (
        "import sys; from stopgo.spared_modules import SPARED_OF_RERUN, load_when_used; "
        "load_when_used(SPARED_OF_RERUN); import stopgo.recordings.plan; "
        "print({type(sys.modules[name]).__name__ for name in SPARED_OF_RERUN})"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "{'_LazyModule'}"


def test_a_second_call_changes_nothing(package: str) -> None:
    for _ in range(2):
        load_when_used([f"{package}.heavy"])
    assert sys.meta_path.count(sys.meta_path[0]) == 1

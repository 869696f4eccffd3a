"""Kernels run as built by the installation, or as written, with the same results."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stopgo.planner.geometry import compiling
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.tour import nanometres, search, trials
from stopgo.planner.routing.tour_kernel import iterated_search
from tests.faults.sizes import size
from tests.planner.kernels import interpret, machine_code

ROOT = Path(__file__).parents[3]
KERNELS = {
    path: path.with_name(path.name.replace("_compiled.pxd", ".py"))
    for path in sorted((ROOT / "planner").rglob("*_compiled.pxd"))
}
"""The source of each kernel, by the file of its types."""


@pytest.fixture
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    compiling._say_that_plans_take_longer.cache_clear()
    monkeypatch.setattr(compiling, "compiled_module", lambda name: None)


def test_an_uncompiled_kernel_is_reported_once_and_before_large_work_only(
    nothing_said: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert compiled(iterated_search, large=False) is None
    assert capsys.readouterr().err == ""
    assert compiled(iterated_search, large=True) is None
    assert compiled(iterated_search, large=True) is None
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "kernels are not compiled" in told


def test_a_tour_is_the_same_at_both_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(5).random((40, 2))
    cost = nanometres(np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)))
    fast = search(cost, trials(cost, 200, seed=1))
    interpret(monkeypatch)
    assert np.array_equal(fast, search(cost, trials(cost, 200, seed=1)))


def test_the_types_of_a_kernel_name_all_its_functions() -> None:
    """A function that they miss would stay interpreted, and slow, without a word."""
    assert len(KERNELS) > 2
    for types, source in KERNELS.items():
        written = {
            node.name for node in ast.parse(source.read_text()).body if isinstance(node, ast.FunctionDef)
        }
        assert written == set(re.findall(r"^cp?def .*?(\w+)\(", types.read_text(), re.MULTILINE)), source


def test_the_machine_code_is_of_the_present_source() -> None:
    """A build older than its source would test something else."""
    for types, source in KERNELS.items():
        name = ".".join(source.relative_to(ROOT).with_suffix("").parts)
        module = compiling.compiled_module(f"stopgo.{name}")
        assert module is not None, "not compiled: `python setup.py build_ext --inplace`, with gcc and Cython"
        assert Path(module.__file__).stat().st_mtime >= max(source.stat().st_mtime, types.stat().st_mtime)


def test_arrays_that_cannot_be_written_are_taken(tmp_path: Path) -> None:
    cost = np.arange(16, dtype=np.int64)
    cost.flags.writeable = False
    scratch = [np.zeros(8, dtype=np.int64) for _ in range(9)]
    with pytest.raises(ValueError, match="dtype"):
        machine_code(iterated_search)(cost.astype(np.int32), *scratch)


def test_without_a_compiler_the_installation_is_complete_and_interpreted(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    ignored = shutil.ignore_patterns(".*", "tests", "docs", "build", "*_compiled*.so", "*.egg-info")
    shutil.copytree(ROOT, tree, ignore=ignored, symlinks=True)
    for other in [*tree.rglob("*_compiled.pxd")][size(short=1, full=len(KERNELS)) :]:
        other.unlink()
    done = subprocess.run(
        [sys.executable, "setup.py", "-q", "build", "--build-lib", str(tmp_path / "lib")],
        cwd=tree,
        env={**os.environ, "CC": "/nowhere/cc", "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "lib" / "stopgo" / "planner" / "routing" / "tour_kernel.py").exists()
    assert not list((tmp_path / "lib").rglob("*_compiled*.so"))

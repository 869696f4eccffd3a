"""A kernel runs wherever it is called, whether or not its machine code can be kept on disk."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from pickle import UnpicklingError

import pytest

from stopgo.planner.geometry.compiling import recompiled_if_unreadable

ROOT = Path(__file__).parents[3]
NO_FILE_GROWS = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
CALL = """
import stopgo.planner.geometry.compiling, stopgo.planner.visibility.sight.kernel as kernel
tell = stopgo.planner.geometry.compiling.compiled(kernel.within_reach)
print(stopgo.planner.geometry.compiling.__file__, tell(3, 4, 3, 4, 1, 2, 5), tell(3, 4, 3, 4, 1, 2, 4))
"""


def called(folder: Path, code: str = CALL, **environment: str) -> None:
    """Let a process call a kernel of the planner in `folder`, and hear the right answers."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, **environment},
        check=False,
    )
    assert (done.stdout.split()[1:], done.stderr) == (["True", "False"], "")
    assert Path(done.stdout.split()[0]).is_relative_to(folder)


def test_a_read_only_install_and_a_user_without_a_home(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "stopgo", tmp_path / "stopgo", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "stopgo" / "planner" / "__pycache__").write_text("where nothing can be written")
    called(tmp_path, HOME="/dev/null", XDG_CACHE_HOME="/dev/null", NUMBA_CACHE_DIR="/dev/null/cache")


def test_a_full_disk_under_the_cache(tmp_path: Path) -> None:
    called(ROOT, NO_FILE_GROWS + CALL, NUMBA_CACHE_DIR=str(tmp_path))
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_cache_that_was_cut_off(tmp_path: Path) -> None:
    called(ROOT, NUMBA_CACHE_DIR=str(tmp_path))
    kept = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(kept) == 2
    for path in kept:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    called(ROOT, NUMBA_CACHE_DIR=str(tmp_path))


@pytest.mark.parametrize("error", [OSError, EOFError, UnpicklingError])
def test_whatever_is_wrong_with_the_cache_the_kernel_is_compiled_anew(error: type[Exception]) -> None:
    def kept(number: int) -> int:
        raise error

    assert recompiled_if_unreadable(kept, lambda number: number + 1)(1) == 2

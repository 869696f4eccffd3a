"""With only the base dependencies a robot works, and planning says what to install."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from stopgo.command_line import EXTRAS
from tests.journeys.readme import ROOT

WITHOUT_EXTRAS = f"""
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(EXTRAS)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


def without_extras(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a Python in which no optional library can be imported."""
    return subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS + code, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_the_nouns_and_the_bridge_import() -> None:
    done = without_extras(
        "import stopgo.mission, stopgo.bridge, stopgo.mission.files.mission_json\n"
        "import stopgo.bridge.robot.program, stopgo.bridge.station.station"
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (("plan", "recordings/samples/office.dxf"), "plan"),
        (("demo",), "plan"),
        (("review", "README.md"), "record"),
    ],
)
def test_a_command_names_the_extra_it_needs(arguments: tuple[str, ...], extra: str, tmp_path: Path) -> None:
    front_door = "from stopgo.command_line import main\nsys.exit(main(sys.argv[1:]))"
    output = ["-o", str(tmp_path)] if arguments[0] != "review" else []
    done = without_extras(front_door, *arguments, *output)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f'pip install "stopgo[{extra}]"' in done.stderr


def test_every_command_has_its_help() -> None:
    done = without_extras("from stopgo.command_line import main\nsys.exit(main(['--help']))")
    assert done.returncode == 0
    assert {"plan", "robot", "push", "watch"} <= set(done.stdout.split())

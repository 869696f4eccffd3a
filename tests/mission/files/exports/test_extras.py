"""Without the extras the plain formats are written, and the others say what to install."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.files import mission_json
from stopgo.mission.files.exports import FORMATS
from tests.journeys.test_base import without_extras
from tests.mission.files.exports.worlds import laboratory

NEEDS = {"dxf": "plan", "mcap": "record"}
FRONT_DOOR = "from stopgo.command_line import main\nsys.exit(main(sys.argv[1:]))"


EXPORTING = """
from stopgo.command_line import main
print([main(["export", sys.argv[1], "-o", out]) for out in sys.argv[2:]])
"""


def test_a_robots_computer_exports_what_needs_no_extra(tmp_path: Path) -> None:
    mission_json.write(laboratory(), tmp_path / "mission.json")
    out = [tmp_path / name / f"site{FORMATS[name].suffix}" for name in FORMATS if name not in NEEDS]
    for path in out:
        path.parent.mkdir()
    done = without_extras(EXPORTING, str(tmp_path / "mission.json"), *map(str, out))
    assert done.stdout.splitlines()[-1] == str([0] * len(out)), done.stderr
    assert all(path.exists() for path in out)


@pytest.mark.parametrize("name", NEEDS)
def test_a_robots_computer_says_which_extra_a_format_needs(name: str, tmp_path: Path) -> None:
    mission_json.write(laboratory(), tmp_path / "mission.json")
    out = tmp_path / f"site{FORMATS[name].suffix}"
    done = without_extras(FRONT_DOOR, "export", str(tmp_path / "mission.json"), "-o", str(out))
    assert (done.returncode, out.exists()) == (2, False)
    assert f'pip install "stopgo[{NEEDS[name]}]"' in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_robots_computer_imports(tmp_path: Path) -> None:
    (tmp_path / "stops.csv").write_text("x_m,y_m\n1,2\n")
    paths = [str(tmp_path / name) for name in ("stops.csv", "mission.json")]
    done = without_extras(FRONT_DOOR, "import", paths[0], "-o", paths[1])
    assert done.returncode == 0, done.stderr

"""Without the extras the plain formats are written, and the others say what to install."""

from __future__ import annotations

from pathlib import Path

import pytest

from mission.files import mission_json
from mission.files.exports import FORMATS
from tests.journeys.test_base import without_extras
from tests.mission.exports.worlds import laboratory

NEEDS = {"dxf": "plan", "mcap": "record"}
FRONT_DOOR = "from mission.__main__ import main\nsys.exit(main(sys.argv[1:]))"


@pytest.mark.parametrize("name", FORMATS)
def test_a_robots_computer_exports_what_needs_no_extra(name: str, tmp_path: Path) -> None:
    mission_json.write(laboratory(), tmp_path / "mission.json")
    out = tmp_path / f"site{FORMATS[name].suffix}"
    done = without_extras(FRONT_DOOR, "export", str(tmp_path / "mission.json"), "-o", str(out))
    if name not in NEEDS:
        assert (done.returncode, out.exists()) == (0, True), done.stderr
        return
    assert (done.returncode, out.exists()) == (2, False)
    assert f'pip install "stopgo[{NEEDS[name]}]"' in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_robots_computer_imports(tmp_path: Path) -> None:
    (tmp_path / "stops.csv").write_text("x_m,y_m\n1,2\n")
    paths = [str(tmp_path / name) for name in ("stops.csv", "mission.json")]
    done = without_extras(FRONT_DOOR, "import", paths[0], "-o", paths[1])
    assert done.returncode == 0, done.stderr

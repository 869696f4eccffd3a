"""A key of very many parts is refused before it is read."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.settings.toml_file import MOST_DOTS, read_toml


@pytest.mark.parametrize("line", ["{} = 1", "[{}]", "[[ {} ]]"])
def test_a_key_of_very_many_parts_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    """50 000 parts took 6 GB, as each part has a copy of those before it."""

    def read(text: str) -> dict:
        raise AssertionError("such a file was read")

    monkeypatch.setattr(tomllib, "loads", read)
    path = tmp_path / "plan.toml"
    path.write_text(line.format(".".join(["a"] * (MOST_DOTS + 2))))
    with pytest.raises(InputError, match=f"a key has more than {MOST_DOTS} dots"):
        read_toml(path)


def test_dots_in_values_and_comments_are_no_parts_of_keys(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(f"# {'.' * 2000}\nname = '{'.' * 2000}'\n")
    assert read_toml(path) == {"name": "." * 2000}

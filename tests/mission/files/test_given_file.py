"""A table's separator is found, and a file that cannot be read is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import bytes_of, rows_of


@pytest.mark.parametrize("separator", ",;\t")
def test_a_table_has_the_separator_of_its_first_line(separator: str) -> None:
    text = f"\na{separator}b\n1{separator}2\n\n"
    assert rows_of(text, "t.csv") == [(2, ["a", "b"]), (3, ["1", "2"])]


def test_a_quoted_cell_may_hold_a_line_break() -> None:
    assert rows_of('a,b\n"1\n2",3\n', "t.csv")[1] == (3, ["1\n2", "3"])


def test_damaged_quotes_are_refused_where_they_matter() -> None:
    assert rows_of('a,b\n"1"2,3\n', "t.csv")[1][1] == ["12", "3"]
    with pytest.raises(InputError, match=r"t\.csv: not a table"):
        rows_of('a,b\n"1"2,3\n', "t.csv", strict=True)


@pytest.mark.parametrize("name", ["none.csv", ".", "a\0b"])
def test_a_file_that_cannot_be_read_is_named_with_the_remedy(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"cannot be read .*; give a table"):
        bytes_of(tmp_path / name, "give a table")

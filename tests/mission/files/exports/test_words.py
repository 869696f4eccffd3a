"""Names and ids of any letters pass through every format, and nothing of them acts there."""

from __future__ import annotations

import csv
import io
import json
from itertools import product

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from stopgo.mission.document import Mission, with_digest
from stopgo.mission.files.exports import FORMATS, exported
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.imports import READERS
from stopgo.mission.files.imports.track import ImportOptions
from tests.faults.sizes import some
from tests.mission.files.exports.worlds import laboratory

words = st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=20)
HOSTILE = (
    '=HYPERLINK("http://x")',
    "'=1",
    "a\r\nb",
    "x: [y]\n- z",
    "%%c\\P{\\H3;}",
    "\u2028\x85\x1b[31m",
    "#",
    ",;\t",
)


def named(word: str) -> Mission:
    """The laboratory, with mission, frame, profile and a stop of that name."""
    made = laboratory()
    first = made.stops[0]
    scan = msgspec.structs.replace(first.scan, profile=word)
    stops = (msgspec.structs.replace(first, id=word, scan=scan), *made.stops[1:])
    frame = msgspec.structs.replace(made.frame, name=word)
    return with_digest(msgspec.structs.replace(made, name=word, frame=frame, stops=stops))


@pytest.mark.parametrize(("word", "name"), some([*product(HOSTILE, FORMATS)], every=3))
def test_hostile_names_pass_every_format(name: str, word: str) -> None:
    assert exported(named(word), name, Supplements())


def any_word(test):
    for word in HOSTILE:
        test = example(word=word)(test)
    return given(word=words)(test)


@any_word
def test_yaml_holds_poses_and_legs_and_nothing_else(word: str) -> None:
    document = YAML(typ="safe").load(exported(named(word), "nav2", Supplements()).decode())
    assert list(document) == ["waypoints", "return"]
    kinds = [set(waypoint) for waypoint in document["waypoints"].values()]
    assert kinds == [{"pose", "orientation", "approach"}] * 3


@any_word
def test_a_table_keeps_the_word_and_no_cell_is_a_formula(word: str) -> None:
    data = exported(named(word), "csv", Supplements())
    row = next(csv.DictReader(io.StringIO(data.decode(), newline="")))
    for cell in (row["id"], row["scan_profile"]):
        assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
        assert (cell[1:] if cell.startswith("'") else cell) == word
    if "\0" not in word:
        assert READERS["csv"](data, "t", ImportOptions()).visits[0].id == word


@any_word
def test_json_formats_keep_the_word(word: str) -> None:
    points = json.loads(exported(named(word), "geojson", Supplements()))
    assert points["name"] == word
    assert points["features"][0]["properties"]["id"] == word
    plan = exported(named(word), "plan", Supplements())
    assert READERS["plan"](plan, "p", ImportOptions()).visits[0].id == word
    order = json.loads(exported(named(word), "vda5050", Supplements()))
    assert next(node["nodeId"] for node in order["nodes"] if node["actions"]) == word

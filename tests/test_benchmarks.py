"""Tables of figures say with what code they were measured, and those of older code say so."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from benchmarks import ages
from benchmarks.__main__ import ALL
from benchmarks.ages import Section, digest, marked, sections, stamp

pytestmark = pytest.mark.together("sources")


@pytest.fixture(autouse=True, scope="module")
def _imports_are_read_once() -> Iterator[None]:
    """Read the imports of each module once, for all benchmarks that load it."""
    names = cache(lambda module: tuple(_names(module)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ages, "_names", names)
        yield


_names = ages._names

BLOCKS = """
## Growth

<!-- growth: begin -->
### by area

| m² | s |
| --- | --- |
| 1 | 2 |

{}
<!-- growth: end -->

## Words only

## By hand

| a | b |
|---|---|
| 1 | 2 |
"""


def test_every_table_is_of_the_present_code_or_says_that_it_is_older() -> None:
    found = sections(ages.README.read_text(encoding="utf-8"))
    assert len(found) > 20
    problems = [section.problem for section in found if section.problem]
    assert not problems, "measure these, or mark them with: python -m benchmarks.ages"


def test_a_table_without_a_stamp_is_a_problem() -> None:
    growth, by_hand = sections(BLOCKS.format(""))
    assert growth.problem == "growth: does not say with what code it was measured"
    assert "a table outside of all blocks" in by_hand.problem


def test_a_stamp_holds_until_the_code_changes_and_then_a_mark_is_needed() -> None:
    text = BLOCKS.format(stamp("growth", "2026-11-24"))
    assert sections(text)[0].problem == ""
    assert marked(text) == text
    older = text.replace(digest("growth"), "0123456789ab")
    assert "older than its code (growth)" in sections(older)[0].problem
    assert sections(marked(older))[0].problem == ""
    assert "Older than the code: measured 2026-11-24, code 0123456789ab (growth)." in marked(older)
    assert marked(marked(older)) == marked(older)


@pytest.mark.parametrize(
    ("other", "same"),
    [
        ('"""Other words."""\nA = 1\n\n\ndef f(x):\n    """More."""\n    # why\n    return x + A\n', True),
        ('"""Words."""\nA = 2\n\n\ndef f(x):\n    return x + A\n', False),
        ('"""Words."""\nA = 1\n\n\ndef f(x):\n    return x - A\n', False),
        ('"""Words."""\nA = 1\n\n\ndef f(x, y=None):\n    return x + A\n', False),
    ],
)
def test_words_and_layout_do_not_age_a_table_and_code_does(other: str, same: bool) -> None:
    source = '"""Words."""\nA = 1\n\n\ndef f(x):\n    return x + A\n'
    assert (ages._told(source) == ages._told(other)) == same


def test_what_a_benchmark_starts_belongs_to_what_it_measures() -> None:
    plans = ages._imported(["benchmarks.whole_plans", *ages.BY_COMMAND["whole-plans"]])
    reader, kernel = "stopgo.planner.floors.dxf", "stopgo.planner.visibility.sight.kernel"
    assert {reader, kernel, "stopgo.planner", "benchmarks.floors"} <= plans
    assert not any(module.startswith("stopgo.bridge") for module in plans)
    assert all(ages._path(module) for names in ages.BY_COMMAND.values() for module in names)


def test_each_benchmark_that_writes_a_table_is_stamped_by_its_name() -> None:
    for path in Path(ages.__file__).parent.glob("*.py"):
        for name in re.findall(r"\b(?:lines_)?put\(\s*\"([\w-]+)\"", path.read_text(encoding="utf-8")):
            assert ages.MODULE_OF.get(name, name).replace("-", "_") == path.stem
            assert re.fullmatch("[0-9a-f]{12}", digest(name))


def test_one_command_writes_every_table_but_the_comparison_with_a_former_version() -> None:
    names = {section.name for section in sections(ages.README.read_text(encoding="utf-8"))}
    modules = {ages.MODULE_OF.get(name, name).replace("-", "_") for name in names}
    assert modules == set(ALL)


def test_a_section_of_current_and_older_tables_is_as_old_as_the_oldest() -> None:
    text = f"| a |\n|---|\n\n{stamp('tours')}\n\nMeasured 2026-11-24, code 0123456789ab (ways)."
    assert "(ways)" in Section("Tours", text).problem

"""The list of tests that run in the long form alone names tests that are there."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.faults.sizes import LONG_FORM, is_long

TESTS = Path(__file__).parent


def test_every_line_names_a_test_once() -> None:
    lines = LONG_FORM.read_text(encoding="utf-8").splitlines()
    assert lines == sorted(set(lines))
    by_file: dict[str, set[str]] = {}
    for line in lines:
        file, _, case = line.partition("::")
        by_file.setdefault(file, set()).add(case.partition("[")[0])
    for file, functions in by_file.items():
        tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
        assert functions <= {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, file


def test_a_function_in_the_list_stands_for_all_its_cases() -> None:
    lines = LONG_FORM.read_text(encoding="utf-8").splitlines()
    case = next(line for line in lines if line.endswith("]"))
    function = next(line for line in lines if not line.endswith("]"))
    assert is_long(f"tests/{case}") and not is_long(f"tests/{case[:-1]}, other]")
    assert is_long(f"tests/{function}") and is_long(f"tests/{function}[any case]")

"""Entity paths: one name for each, and one path for each name."""

from __future__ import annotations

import ast
from pathlib import Path

from stopgo.recordings.drawing import entities


def test_no_entity_is_named_twice() -> None:
    """A name given again would move what the first one drew to another path."""
    tree = ast.parse(Path(entities.__file__).read_text(encoding="utf-8"))
    names = [
        target.id
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    ]
    assert len(names) == len(set(names))


def test_the_candidates_plot_lies_next_to_the_other_plots_of_coverage() -> None:
    assert entities.CANDIDATE_COVERAGE.startswith(f"{entities.METRIC_COVERAGE}/")

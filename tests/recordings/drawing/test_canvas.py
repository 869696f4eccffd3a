"""Arrays that a canvas hands to Rerun equal those that Rerun would make itself."""

from __future__ import annotations

import rerun as rr

from stopgo.recordings.drawing import palette
from stopgo.recordings.drawing.canvas import arrow_of_classes


def test_classes_are_those_that_rerun_would_make() -> None:
    rows = palette.class_rows()
    assert arrow_of_classes(rows).equals(rr.components.AnnotationContextBatch(rows).as_arrow_array())

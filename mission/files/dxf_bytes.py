"""Reproducible bytes of DXF drawings: without ezdxf's dates, identifiers and set orders."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ezdxf.document import Drawing


@contextmanager
def reproducible() -> Iterator[None]:
    """Make ezdxf write no dates and no random identifiers; drawings are created inside the block."""
    import ezdxf

    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def encoded(drawing: Drawing) -> bytes:
    """Return the file; ezdxf lists its classes in the order of a set, which differs from run to run."""
    drawing.classes.add_required_classes(drawing.dxfversion)
    drawing.classes.classes = dict(sorted(drawing.classes.classes.items()))
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode("utf-8")

"""Libraries that reading a model loads, in the process of its own and before."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("module", "spared"), [("extract", "ezdxf pyproj scipy"), ("storey_reader", "ezdxf ifcopenshell")]
)
def test_reading_a_model_loads_no_library_that_it_does_not_use(module: str, spared: str) -> None:
    """They took 1.5 s, half of the time of reading a small model."""
    code = f"import sys, stopgo.planner.floors.ifc.{module}; print({{*{spared.split()}}} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert done.stdout.strip() == "set()"

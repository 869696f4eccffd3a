"""Hypothesis for this folder: no deadlines on a shared machine, and the same examples every time."""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("mission", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, max_examples=20_000)
settings.load_profile(os.environ.get("STOPGO_HYPOTHESIS", "mission"))

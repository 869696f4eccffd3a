"""Modules that plans use, loaded once in the process from which a batch's workers are forked.

Rerun is left out: it starts threads when it is loaded, and threads do not outlive a fork.
"""

# ruff: noqa: F401, E402
from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the workers use the cores

from stopgo.spared_modules import load_when_used

load_when_used()

import highspy
import scipy.spatial

import stopgo.mission.files.coverage_json
import stopgo.mission.files.plan_sheets
import stopgo.plan_files
import stopgo.planner.candidates
import stopgo.planner.checking.model_clearance
import stopgo.planner.checking.seen_surface
import stopgo.planner.commands.plan_report
import stopgo.planner.floors.dxf
import stopgo.planner.overlap.registered
import stopgo.planner.routing
import stopgo.planner.selection.accurate
import stopgo.planner.selection.continuous_selection
import stopgo.planner.visibility

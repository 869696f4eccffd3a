"""Poses belong to the run that had begun when they were measured."""

from __future__ import annotations

import pytest

from tests.bridge.world import Field, corridor


def test_a_run_that_begins_while_a_pose_is_measured_does_not_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    field, runs = Field(), []
    field.station().push(corridor())
    measured, add = field.controller.position, field.agent._poses.add

    def position() -> object:
        found = measured()
        if field.controller.run.run_id is None:
            assert field.order("start").outcome == "ok"
        return found

    def added(found: object, run: object, boot_id: str) -> object:
        report = add(found, run, boot_id)
        runs.append(report.run_id)
        if len(runs) == 2:
            field.agent._closing.set()
        return report

    monkeypatch.setattr(field.controller, "position", position)
    monkeypatch.setattr(field.agent._poses, "add", added)
    monkeypatch.setattr(field.agent, "_publish_pose", lambda data: None, raising=False)
    field.agent._publish_poses()
    assert runs == [None, field.controller.run.run_id]

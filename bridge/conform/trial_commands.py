"""Commands to a robot under test, and the answers that they must get."""

from __future__ import annotations

import uuid
from typing import Any

from stopgo.bridge.conform.requirements import must, short
from stopgo.bridge.conform.robot_queries import RobotQueries
from stopgo.bridge.link.protocol import encode
from stopgo.mission.run.run_commands import Answer, RunCommand, Verb


class TrialCommands:
    """Commands made for the robot's present boot and clock."""

    def __init__(self, robot: RobotQueries) -> None:
        self._robot = robot

    def order(self, verb: Verb, **details: Any) -> RunCommand:
        """Make a command for the robot's present boot and clock; `details` replace its fields."""
        info = self._robot.info()
        meant: dict[str, Any] = {
            "cmd_id": uuid.uuid4().hex, "commander": self._robot.commander, "issued_ns": info.clock_ns,
            "valid_for_s": self._robot.timeout_s, "boot_id": info.boot_id,
        }  # fmt: skip
        return RunCommand(verb=verb, **(meant | details))

    def give(self, order: RunCommand) -> Answer:
        """Send a command, and return the answer."""
        return self._robot.ask_for(Answer, self._robot.keys.command(order.verb), encode(order))

    def must_execute(self, verb: Verb, **details: Any) -> Answer:
        """Send a command that must be executed, and return the answer."""
        answer = self.give(self.order(verb, **details))
        must(answer.outcome == "ok", f"{verb} was refused: {answer.reason}: {short(answer.message)}")
        return answer

    def must_refuse(self, order: RunCommand, *reasons: str) -> Answer:
        """Send a command that must be refused for one of these reasons, and return the answer."""
        answer = self.give(order)
        must(answer.outcome == "refused", f"{order.verb} was carried out; it had to be refused")
        must(
            answer.reason in reasons,
            f"{order.verb} was refused as {answer.reason}, not as {' or '.join(reasons)}",
        )
        return answer

"""A robot or a station of an older version, as its recorded traffic shows it.

A recording has one JSON object a line, in order: a question with its answer (`key`, `parameters`, `request`,
`reply`), a publication (`key`, `published`), or how far the robot has worked meanwhile (`robot`).
"""

from __future__ import annotations

import json
from collections import defaultdict, deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stopgo.bridge.link.link import Request, Unanswered
from tests.bridge.world import Field

FOLDER = Path(__file__).parent
NEW = "of_a_later_version"
"""A field that no version knows."""

Change = Callable[[Any], Any]


def traffic(version: str) -> list[dict[str, Any]]:
    text = (FOLDER / f"protocol_{version}.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


def as_recorded(message: Any) -> Any:
    return message


def with_new_fields(message: Any) -> Any:
    """The message with an unknown field in it and in the objects that the protocol itself defines."""
    if not isinstance(message, dict):
        return message
    inner = {name: with_new_fields(message[name]) for name in ("state", "manifest") if name in message}
    return {**message, **inner, NEW: {"any": [1]}}


def changed(text: str, change: Change) -> bytes:
    """A recorded payload after a change of its JSON; chunks of a mission stay as they are."""
    if not text or '"schema":"stopgo/mission"' in text[:40]:
        return text.encode()
    return json.dumps(change(json.loads(text))).encode()


WORKED: dict[str, Callable[[Field], object]] = {
    "has done s1": lambda field: field.work_until(lambda run: run.done == ("s1",)),
    "scans": lambda field: field.work_until(lambda run: run.stop_state == "SCANNING"),
    "rests": lambda field: field.work(),
}


class RecordedStation:
    """Sends its recorded questions to today's robot, and yields each with the recorded and today's answer."""

    def __init__(self, version: str, field: Field, change: Change) -> None:
        self._lines, self._field, self._change = traffic(version), field, change
        self._now: dict[str, str] = {}
        """Today's boot and run ids, by those of the recording."""

    def play(self) -> list[tuple[str, Any, Any]]:
        link, answers = self._field.board.link(), []
        for line in self._lines:
            if "robot" in line:
                WORKED[line["robot"]](self._field)
            elif "reply" in line:
                asked = changed(self._today(line["request"]), self._change)
                raw = link.ask(line["key"], asked, timeout_s=1.0, parameters=line["parameters"])
                assert raw is not None, line["key"]
                then, now = json.loads(line["reply"]), json.loads(raw)
                self._learn(then, now)
                answers.append((line["key"], then, now))
        return answers

    def _learn(self, then: Any, now: Any) -> None:
        for name in ("boot_id", "run_id"):
            if then.get(name) and now.get(name):
                self._now[then[name]] = now[name]

    def _today(self, text: str) -> str:
        for then, now in self._now.items():
            text = text.replace(then, now)
        return text


class RecordedRobot:
    """Answers today's station as recorded: each key's answers in order, the last one again and again."""

    def __init__(self, version: str, change: Change) -> None:
        self._change = change
        self._replies: dict[str, deque[str]] = defaultdict(deque)
        for line in traffic(version):
            if "reply" in line:
                self._replies[line["key"]].append(line["reply"])

    def answer(self, request: Request) -> bytes:
        replies = self._replies[request.key]
        if not replies:
            raise Unanswered
        reply = json.loads(replies.popleft() if len(replies) > 1 else replies[0])
        if reply["is"] == "Answer":
            reply["cmd_id"] = json.loads(request.payload)["cmd_id"]
        return json.dumps(self._change(reply)).encode()

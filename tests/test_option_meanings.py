"""One option, one meaning: an option of several commands means the same in each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from stopgo.command_line import front_door
from stopgo.renamed_options import RENAMED, NewName

MEANINGS = {
    "--angular-step": "angle between neighbouring rays of the scanner",
    "--arm": "arm the vehicle",
    "--at": "initial pose of what is simulated",
    "--autopilot": "kind of autopilot",
    "--battery-life": "runtime per charge",
    "--connect": "zenoh endpoint to connect to",
    "--coverage-file": "the mission's coverage.json",
    "--fault": "fault to simulate",
    "--floor": "file of the floor that the mission was planned on",
    "--html": "report to write, as one HTML file",
    "--json": "one JSON object on stdout",
    "--listen": "address to listen at",
    "--map": "transform from the site to a map",
    "--mavlink": "MAVLink address",
    "--mission": "mission.json that the command works with",
    "--no-strict": "opposite of --strict",
    "--origin": "position on Earth of the site's origin",
    "--out": "file or folder to write",
    "--parameters": "plan.toml",
    "--robot": "name of the robot",
    "--ros2": "domain and namespace of a robot with ROS 2",
    "--seed": "seed of the random numbers",
    "--set-origin": "give a vehicle without an origin the mission's",
    "--since": "only what was finished after a day",
    "--speed-up": "factor by which simulated time runs faster",
    "--start": "start pose of the robot",
    "--state": "folder for what must outlast a restart",
    "--strict": "exit 1 also for a doubtful result",
    "--timeout": "longest wait for an answer",
    "--trigger": "trigger of the scanner",
    "--vehicle": "MAVLink system id",
    "--view": "open the viewer",
    "-o": "file or folder to write",
    "-p": "plan.toml",
}
"""Meaning of each option whose help differs between commands. Only the command's own details differ."""


def commands(command: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """All commands and subcommands by name."""
    below = getattr(command, "commands", None)
    if below is None:
        yield name, command
        return
    for word, one in below.items():
        yield from commands(one, f"{name} {word}".strip())


def helps() -> dict[str, set[str]]:
    """Help texts of each option over all commands."""
    found: dict[str, set[str]] = defaultdict(set)
    for _, command in commands(front_door()):
        for parameter in command.params:
            if parameter.param_type_name == "option":
                for option in (*parameter.opts, *parameter.secondary_opts):
                    found[option].add((parameter.help or "").partition("  [default")[0].rstrip("."))
    return found


def test_an_option_with_two_help_texts_has_one_declared_meaning() -> None:
    """A new difference must be given one meaning here, or one of the options another name."""
    assert sorted(option for option, texts in helps().items() if len(texts) > 1) == sorted(MEANINGS)


def test_every_renamed_option_exists_under_its_new_name() -> None:
    takes = {
        name: {option for parameter in command.params for option in parameter.opts}
        for name, command in commands(front_door())
    }
    for verb, renamed in RENAMED.items():
        options = {option for name in takes if name.split()[0] == verb for option in takes[name]}
        assert options, verb
        for old, new in renamed.items():
            assert not isinstance(new, NewName) or new.option in options, (verb, old)

"""The text of `stopgo --help`, and the nearest command for a word that is none; loads no library."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

from stopgo.mission.errors import InputError

COMMAND_GROUPS: Mapping[str, Mapping[str, str]] = {
    "Plan": {
        "plan": "Plan the scan stops and the route",
        "batch": "Plan many floors, dates and variants",
        "floors": "Report the floors in a file",
        "convert": "Write a floor as a layered DXF",
        "show": "Print a mission as a table",
        "check": "Check that a mission is valid",
        "prove": "Verify a mission by simulation",
        "export": "Write a mission in another format",
        "import": "Make a mission from another format",
    },
    "Run and look back": {
        "push": "Send a mission to a robot",
        "start": "Start the mission on the robot",
        "pause": "Pause the robot at standstill",
        "resume": "Resume a paused robot",
        "skip": "Skip the current stop",
        "retry": "Let a robot that is held try again",
        "abort": "End the run at the present position",
        "home": "End the run and drive back",
        "status": "Print the state of the robots",
        "session": "Hold a session open for commands",
        "watch": "Follow and record a run",
        "site": "Plan, run and review in the browser",
        "review": "Compare recordings with their plan",
        "runs": "List the plans and runs in a folder",
        "replay": "Compare a robot's own log with a mission",
    },
    "Robots and upkeep": {
        "robot": "Run the robot agent",
        "guard": "Stop a ROS 2 robot whose link is cut",
        "simulate": "Simulate a MAVLink vehicle",
        "fetch-mission": "Read the mission of a MAVLink vehicle",
        "clear": "Clear the mission of a MAVLink vehicle",
        "align": "Fit the site to a robot's map",
        "tunnel": "Carry MAVLink frames over zenoh",
        "doctor": "Check presets, keys, robot and vehicle",
        "keys": "Create, renew and revoke a site's keys",
        "conform": "Test a third-party robot or station",
        "demo": "Plan and run a sample office",
    },
}
"""Every command once, with a phrase that fits into 60 columns."""

_HEAD = """\
Usage: stopgo COMMAND ...    or  stopgo COMMAND --help"""
_FOOT = "Also: --version --install-completion --show-completion"


def root_help() -> str:
    """Return the help of `stopgo`: every command, in groups; no line exceeds 60 columns."""
    lines = [_HEAD]
    for group, commands in COMMAND_GROUPS.items():
        lines.append(f"{group}:")
        lines += [f"  {word:<13}  {phrase}" for word, phrase in commands.items()]
    return "\n".join([*lines, _FOOT])


def must_be_command(word: str, known: tuple[str, ...]) -> None:
    """Refuse a word that is no command, with the nearest one."""
    if word.startswith("-") or word in known:
        return
    near = get_close_matches(word.lower(), known, n=1)
    remedy = f"the nearest is: stopgo {near[0]}" if near else "see: stopgo --help"
    raise InputError(f"{word}: no such command; {remedy}")

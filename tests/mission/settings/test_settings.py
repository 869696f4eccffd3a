"""Parameters are declared once: file, options, help, checks and Python say the same of each."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest

import stopgo
from stopgo.command_line import main
from stopgo.mission.document.specs import robot_of
from stopgo.mission.errors import InputError
from stopgo.mission.files.plan_toml import read_settings, recorded_settings, settings_toml
from stopgo.mission.settings import PARAMETERS, Settings, recorded_values
from stopgo.mission.settings.parameter_checks import check_settings
from stopgo.mission.settings.scanners import SCANNERS, ScannerName

OTHER: dict[str, Any] = {
    "register": False,
    "heights": ("doors=2.1",),
    "accuracy": 5.0,
    "control": ((1.0, 2.0), (3.0, 4.0)),
    "overlap": 0.25,
    "overlap_range": 15.0,
    "room_coverage": 0.5,
    "kind_coverage": 0.5,
    "targets": ("walls",),
    "layers": ('odd "\\ name=walls',),
    "start": (1.0, 2.0, 90.0),
    "end": (3.0, 4.0),
    "use": ((1.0, 2.0), (3.0, 4.0)),
    "avoid": ((1.0, 2.0, 3.0),),
    "refine": False,
    "time_limit": 3.0,
    "origin": (47.0, 8.5, 400.0, 10.0),
    "robot_radius": 0.3,
    "coverage": 0.8,
    "fov": 180.0,
    "battery_min": 0.2,
    "drawing": 2,
    "layer_map": ("A-WALL=walls", "DIM=ignore"),
    "region": (0.0, 0.0, 30.0, 20.0),
    "level": 3.2,
    "scan_height": 1.5,
    "robot_height": 1.8,
    "date": "2024-05-31",
    "since": "2024-04-30",
    "schedule_columns": ("guid=GlobalId", "task=Name"),
    "views": 2,
    "max_incidence": 70.0,
    "density": 5.0,
    "near": 0.6,
    "angular_step": 0.036,
    "blind_cone": 60.0,
    "range_noise": 6.0,
    "scanner_height": 1.8,
    "wall_height": 2.7,
    "further_starts": ((5.0, 6.0, 0.0),),
    "robots": 2,
    "shift": 1800.0,
    "battery": 5400.0,
}
NEEDS = {
    **dict.fromkeys(("since", "schedule", "in_progress"), ("date",)),
    "density": ("angular_step",),
    "wall_height": ("max_incidence",),
    "robots": ("start",),
    "further_starts": ("start", "robots"),
}
"""Options that have no effect without others."""


def other(name: str) -> Any:
    """A value that is not the default."""
    parameter = PARAMETERS[name]
    if name in OTHER:
        return OTHER[name]
    if parameter.choices:
        return next(word for word in parameter.choices if word != parameter.default)
    if isinstance(parameter.default, bool):
        return not parameter.default
    return parameter.default + 1 if isinstance(parameter.default, int | float) else "other"


def typed(name: str, value: Any) -> list[str]:
    """The options with which a person gives a value."""
    option = PARAMETERS[name].flag
    if isinstance(value, bool):
        return [option if value else f"--no-{option[2:]}"]
    further = name in {item.further for item in PARAMETERS.values()}
    many = value if PARAMETERS[name].repeatable or further else (value,)
    return [f"{option}={','.join(map(str, one)) if isinstance(one, tuple) else one}" for one in many]


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_parameter_is_the_same_as_option_in_the_file_and_in_python(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = {one: other(one) for one in (*NEEDS.get(name, ()), name)}
    facts = SCANNERS[told["scanner"]].values() if "scanner" in told else {}
    expected = replace(Settings(), **facts, **told)
    assert expected != Settings()
    made = stopgo.settings(**told)
    assert made == expected
    assert msgspec.to_builtins(made) == msgspec.to_builtins(expected)  # as missions and recordings tell it
    assert main(["plan", "--print-config", *(word for one in told for word in typed(one, told[one]))]) == 0
    (tmp_path / "plan.toml").write_text(capsys.readouterr().out, encoding="utf-8")
    assert read_settings(tmp_path / "plan.toml", {}) == expected


def test_help_shows_every_option_with_its_default(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--help-all"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    for name, parameter in PARAMETERS.items():
        option = parameter.flag
        said = told[told.index(f" {option} ") :]
        shown = re.match(r".*?\[default: (.*?)\]", said)
        assert shown, name
        if isinstance(parameter.default, float):
            assert float(shown.group(1)) == parameter.default


def limits() -> list[tuple[str, float]]:
    """Values just beyond each declared limit."""
    found = []
    for name, parameter in PARAMETERS.items():
        found += [(name, limit) for limit in (parameter.above, parameter.below) if limit is not None]
        if parameter.least is not None:
            found.append((name, math.nextafter(parameter.least, -math.inf)))
        if parameter.most is not None:
            found.append((name, math.nextafter(parameter.most, math.inf)))
    return found


@pytest.mark.parametrize(("name", "value"), limits())
def test_a_value_beyond_a_limit_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"^{PARAMETERS[name].flag} .*: must "):
        check_settings(replace(Settings(), **{name: value}))


@pytest.mark.parametrize("name", ["speed", "turn_rate", "acceleration"])
def test_a_robot_that_hardly_moves_is_refused(name: str) -> None:
    """Its times would be beyond every number, or its turn rate 0 in the mission's microradians."""
    with pytest.raises(InputError, match=f"^{PARAMETERS[name].flag} 1e-300: must be at least 0.0"):
        check_settings(replace(Settings(), **{name: 1e-300}))


def test_the_slowest_turn_is_not_rounded_away() -> None:
    slowest = PARAMETERS["turn_rate"].least
    assert robot_of(replace(Settings(), turn_rate=slowest)).turn_rate == 0.000175  # 0.01 degrees


@pytest.mark.parametrize("name", [name for name, p in PARAMETERS.items() if p.plain in (int, float)])
def test_no_number_is_endless(name: str) -> None:
    for value in (math.nan, math.inf, -math.inf, 1e7):
        with pytest.raises(InputError, match=f"^{PARAMETERS[name].flag} "):
            check_settings(replace(Settings(), **{name: value}))


OLD = {name: parameter.key for name, parameter in PARAMETERS.items() if parameter.key != name}


@pytest.mark.parametrize("name", OLD)
def test_a_renamed_parameter_keeps_its_old_name_for_one_release(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As an option, in plan.toml and in Python; a line names the new one."""
    option, value = "--" + name.replace("_", "-"), other(name)
    expected = replace(Settings(), **{name: value})
    flag = PARAMETERS[name].flag
    assert main(["plan", "--print-config", *(word.replace(flag, option) for word in typed(name, value))]) == 0
    printed = capsys.readouterr()
    assert printed.err == f"stopgo: {option} is now called {flag}; the old name ends with 0.3\n"
    file = tmp_path / "plan.toml"
    file.write_text(printed.out, encoding="utf-8")
    lines: list[str] = []
    assert read_settings(file, {}, notify=lines.append) == expected
    assert lines == []
    file.write_text(printed.out.replace(f"\n{OLD[name]} = ", f"\n{name} = "), encoding="utf-8")
    assert read_settings(file, {}, notify=lines.append) == expected
    assert lines == [f"{file}: {name} is now called {OLD[name]}; the old name ends with 0.3"]
    assert stopgo.settings(**{name: value}) == stopgo.settings(**{OLD[name]: value}) == expected


def test_a_parameter_given_by_both_names_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text("[plan]\nd_sec = 0.8\nclearance = 0.9\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"clearance in \[plan\] is given by its old and new name"):
        read_settings(tmp_path / "plan.toml", {})


MESSAGES = {
    "speed": (0.0, "--speed 0.0: must be at least 0.001"),
    "range": (0.0, "--range 0.0: must be greater than 0"),
    "settle": (-1.0, "--settle -1.0: must not be negative"),
    "coverage": (90.0, "--coverage 90.0: must be above 0 and at most 1 (0.9 is 90 %)"),
    "battery_min": (1.0, "--battery-min 1.0: must be at least 0 and below 1 (0.15 is 15 %)"),
    "doors": ("ajar", "--doors ajar: known: open, closed"),
    "start": ((1.0,), "--start 1: write X,Y,HEADING, such as 2.5,3.0,90"),
    "use": ((1.0,), "--require-stop 1: write X,Y for each, such as 2.5,3.0"),
    "fov": ("far", "--fov far: Expected `float`, got `str`"),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_a_refusal_says_what_would_be_right(name: str) -> None:
    value, message = MESSAGES[name]
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        stopgo.settings(**{name: value})


def test_a_scanner_gives_what_is_not_given_besides(tmp_path: Path) -> None:
    assert tuple(SCANNERS) == get_args(ScannerName)
    (tmp_path / "plan.toml").write_text('[scanner]\nscanner = "rtc360-medium"\nrange = 8\n', encoding="utf-8")
    settings = read_settings(tmp_path / "plan.toml", {"near": 1.0})
    assert (settings.range, settings.near, settings.blind_cone, settings.scan_time) == (8.0, 1.0, 60.0, 51.0)
    assert settings.angular_step == pytest.approx(math.degrees(0.0006), rel=1e-4)
    assert read_settings(None, recorded_values(settings)) == settings
    with pytest.raises(InputError, match=r"^--scanner none: known: rtc360-high, "):
        stopgo.settings(scanner="none")


def test_limits_that_need_more_say_what(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^--density 5: needs the scanner's --angular-step; .*rtc360-high"):
        stopgo.settings(density=5)
    with pytest.raises(InputError, match=r"^--min-views 2: does not work with --fov 120"):
        stopgo.settings(views=2, fov=120)


def test_a_parameter_that_is_none_is_named() -> None:
    with pytest.raises(InputError, match=r"^colour: no such parameter; known: storey, "):
        stopgo.settings(colour="red")


def test_the_printed_file_explains_itself() -> None:
    lines = settings_toml(Settings()).splitlines()
    assert lines[lines.index("clearance = 0.7") - 1] == "# Minimum distance stop to element, m"
    assert "# robot_radius = (half of min_door_width)" in lines


def test_a_date_without_quotes_is_read_as_its_text(tmp_path: Path) -> None:
    file = tmp_path / "plan.toml"
    file.write_text("[floor]\ndate = 2026-11-30\n", encoding="utf-8")
    assert read_settings(file, {}).date == "2026-11-30"
    file.write_text("[floor]\ndate = 07:32:00\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"^--date 07:32:00: is no day; write it as YYYY-MM-DD"):
        read_settings(file, {})


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("[floor]\nstorey = 1", "storey = 1: .*; write it in quotes$"),
        ('[robot]\nspeed = "0.5"', 'speed = "0.5": .*; write it without quotes$'),
    ],
)
def test_missing_and_extra_quotes_are_named(tmp_path: Path, text: str, remedy: str) -> None:
    (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=remedy):
        read_settings(tmp_path / "plan.toml", {})


TEXTS = [
    name
    for name, parameter in PARAMETERS.items()
    if parameter.form not in ("", "FILE") and name != "further_starts"  # a list of poses
]


@pytest.mark.parametrize("name", TEXTS)
def test_a_value_that_an_option_takes_stands_in_a_file_too(name: str, tmp_path: Path) -> None:
    """A refused `shift = "6min"` was told to write `30min`."""
    parameter = PARAMETERS[name]
    text = re.split(r", | or ", parameter.example)[-1]
    value = f'["{text}"]' if parameter.repeatable else f'"{text}"'
    path = tmp_path / "plan.toml"
    path.write_text(f"[{parameter.section}]\n{parameter.key} = {value}\n")
    given = parameter.given([text] if parameter.repeatable else text)
    assert getattr(read_settings(path, {}), name) == given
    assert getattr(stopgo.settings(**{parameter.key: text}), name) == given


def test_a_text_of_another_form_is_refused_with_the_form(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text('[plan]\nshift = "6 minutes"\n')
    with pytest.raises(InputError, match='shift = "6 minutes": write DURATION, such as 1800, 30min or 1h30'):
        read_settings(path, {})
    with pytest.raises(InputError, match="--shift 30min: write DURATION"):
        recorded_settings({"shift": "30min"})

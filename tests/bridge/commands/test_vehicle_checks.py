"""`stopgo doctor --mavlink`: what stands between a vehicle and a mission, each with the value to set."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from types import SimpleNamespace

import pytest

from stopgo.bridge.commands.vehicle_abilities import alone_text, script_check
from stopgo.bridge.commands.vehicle_checks import has_position, parameter_checks
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import value_of
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.command_line import main
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.autopilots.px4 import PX4
from tests.ports import free_port

pytestmark = pytest.mark.usefixtures("own_time")

INDOORS = {
    "GPS1_TYPE": 0.0, "VISO_TYPE": 1.0, "AHRS_EKF_TYPE": 3.0, "EK3_ENABLE": 1.0, "EK3_SRC1_POSXY": 6.0,
    "EK3_SRC1_VELXY": 6.0, "EK3_SRC1_YAW": 6.0, "WP_RADIUS": 0.05, "MIS_RESTART": 0.0,
}  # fmt: skip
GUIDE = Path(__file__).parents[3] / "docs" / "how-to" / "ardupilot-indoors.md"


def test_a_rover_that_is_set_up_for_indoors_has_nothing_wrong() -> None:
    (told,) = parameter_checks(ARDUPILOT, INDOORS, any_origin=False)
    assert (told.name, told.ok) == ("params", True)
    assert "not reported by the vehicle: FRAME_CLASS" in told.result


@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [
        ("GPS1_TYPE", 1.0, "set GPS1_TYPE to 0"),
        ("EK3_SRC1_POSXY", 3.0, "set EK3_SRC1_POSXY to 6 (external)"),
        ("WP_RADIUS", 2.0, "set WP_RADIUS to 0.05"),
        ("MIS_RESTART", 1.0, "set MIS_RESTART to 0"),
    ],
)
def test_what_is_wrong_is_named_with_the_value_to_set(name: str, value: float, wanted: str) -> None:
    wrong = [
        check
        for check in parameter_checks(ARDUPILOT, {**INDOORS, name: value}, any_origin=False)
        if not check.ok
    ]
    assert [(check.name, check.action) for check in wrong] == [(name, wanted)]


def test_a_parameter_may_have_the_name_of_an_older_release() -> None:
    values = {name: value for name, value in INDOORS.items() if name != "GPS1_TYPE"}
    (wrong,) = [
        c for c in parameter_checks(ARDUPILOT, {**values, "GPS_TYPE": 9.0}, any_origin=False) if not c.ok
    ]
    assert wrong.action == "set GPS_TYPE to 0"


@pytest.mark.parametrize(
    ("name", "all_checks", "none"), [("ARMING_SKIPCHK", 0.0, -1.0), ("ARMING_CHECK", 1.0, 0.0)]
)
def test_a_parameter_may_have_meant_something_else_in_an_older_release(
    name: str, all_checks: float, none: float
) -> None:
    def told(value: float) -> list[str]:
        checks = parameter_checks(ARDUPILOT, {**INDOORS, name: value}, any_origin=False)
        return [check.action for check in checks if check.action]

    assert told(all_checks) == []
    assert told(none) == [f"set {name} to {all_checks:g}"]


def test_who_finds_its_place_by_satellites_needs_no_localisation() -> None:
    outdoors = {"GPS1_TYPE": 1.0, "EK3_SRC1_POSXY": 3.0, "WP_RADIUS": 0.05, "MIS_RESTART": 0.0}
    assert all(check.ok for check in parameter_checks(ARDUPILOT, outdoors, any_origin=True))


@pytest.mark.parametrize(("value", "ok"), [(0, False), (1, False), (9, True), (15, True)])
def test_px4_needs_place_and_heading_from_outside(value: int, ok: bool) -> None:
    told = list(parameter_checks(PX4, {"EKF2_EV_CTRL": float(value)}, any_origin=False))
    assert any(check.name == "EKF2_EV_CTRL" for check in told) is not ok


def test_whole_numbers_of_px4_stand_in_the_float_byte_by_byte() -> None:
    as_float = struct.unpack("<f", struct.pack("<i", 15))[0]
    message = SimpleNamespace(param_type=6, param_value=as_float)
    assert value_of(message, bytewise=True) == 15.0
    assert value_of(SimpleNamespace(param_type=6, param_value=15.0), bytewise=False) == 15.0
    assert value_of(SimpleNamespace(param_type=9, param_value=0.5), bytewise=True) == 0.5


@pytest.mark.parametrize(
    ("flags", "knows"),
    [
        (831, True),  # ArduPilot by external navigation
        (511, True),  # PX4 that stands
        (383, True),  # PX4 that drives
        (0b1000_1001, False),  # held where it was begun
        (0b0000_0001, False),
        (0b0001_1000, False),
    ],
)
def test_an_estimator_has_a_position_to_report(flags: int, knows: bool) -> None:
    assert has_position(flags) is knows


def test_the_guide_names_every_parameter_that_is_looked_at() -> None:
    text = GUIDE.read_text(encoding="utf-8")
    assert [rule.names[0] for rule in ARDUPILOT.parameters if f"`{rule.names[0]}`" not in text] == []


@pytest.mark.parametrize("origin", [None, SiteOrigin(lat=47.0, lon=8.0, alt=400.0, heading_deg=0.0)])
def test_a_vehicle_is_asked_and_not_changed(
    origin: SiteOrigin | None, capsys: pytest.CaptureFixture[str]
) -> None:
    port = free_port()
    setup = VehicleSetup(PROFILES["ardupilot"], origin=origin)
    with vehicle_on(Url("udpin", "127.0.0.1", port), setup):
        code = main(["doctor", "--mavlink", f"udpout:127.0.0.1:{port}", "--json"])
    told = {check["name"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    assert told["vehicle"]["ok"]
    assert told["origin"]["ok"] is (origin is not None)
    assert code == (0 if origin is not None else 1)
    assert "right" in told["params"]["told"]


def test_an_origin_that_is_of_no_use_to_the_vehicle_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    origin = SiteOrigin(lat=47.0, lon=8.0, alt=400.0, heading_deg=0.0)
    faults = VehicleFaults((VehicleFault("unplaced", 1),))
    with vehicle_on(
        Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES["ardupilot"], origin=origin, faults=faults)
    ):
        code = main(["doctor", "--mavlink", f"udpout:127.0.0.1:{port}", "--json"])
    told = {check["name"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    assert (code, told["origin"]["ok"]) == (1, False)
    assert told["origin"]["told"].endswith("in AUTO it would pass over its waypoints")
    assert told["origin"]["do"].startswith("restart it")


def test_nobody_there_is_reported_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--mavlink", f"udpout:127.0.0.1:{free_port()}", "--timeout", "0.3"]) == 1
    assert "no vehicle within 0.3 s" in capsys.readouterr().out
    assert main(["doctor", "--mavlink", "nonsense"]) == 2


def test_one_that_steers_like_a_car_is_wrong_for_a_mission(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    setup = VehicleSetup(PROFILES["px4"], changed={"CA_AIRFRAME": 5.0})
    with vehicle_on(Url("udpin", "127.0.0.1", port), setup):
        assert main(["doctor", "--mavlink", f"udpout:127.0.0.1:{port}"]) == 1
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("WRONG  steering")]
    assert "CA_AIRFRAME is 5, Ackermann" in line and "two driven sides" in line


@pytest.mark.parametrize(
    ("profile", "faults", "expected"),
    [
        (
            "ardupilot",
            (),
            ["read back every 2 s", "the autopilot has a camera", "SCR_ENABLE is not reported"],
        ),
        ("ardupilot", (VehicleFault("camera", 1),), ["component 100 has a camera"]),
        (
            "px4",
            (),
            [
                "by its id",
                "px4 has none",
                "drives on for 1 s (COM_OF_LOSS_T); stopgo robot --set-timeout",
                "by the channel that moved",
            ],
        ),
        (
            "px4",
            (VehicleFault("failsafe", 900, 3.0),),
            ["position estimate, geofence; unknown: remote control"],
        ),
        ("strict", (), ["not with autopilots of kind generic"]),
    ],
)
def test_it_prints_what_the_vehicle_can_do(
    profile: str, faults: tuple[VehicleFault, ...], expected: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    port = free_port()
    origin = SiteOrigin(lat=47.0, lon=8.0, alt=400.0, heading_deg=0.0)
    setup = VehicleSetup(PROFILES[profile], origin=origin, faults=VehicleFaults(faults))
    with vehicle_on(Url("udpin", "127.0.0.1", port), setup):
        main(["doctor", "--mavlink", f"udpout:127.0.0.1:{port}"])
    can = [line for line in capsys.readouterr().out.splitlines() if line.startswith("ok     can")]
    assert len(can) == 6
    assert [words for words in expected if words not in "\n".join(can)] == []


def test_a_vehicle_without_script_engine_or_timeout_is_reported_so() -> None:
    assert script_check(ARDUPILOT, {"SCR_ENABLE": 0.0}).action == "for it set SCR_ENABLE to 1, and restart"
    assert "is not reported" in script_check(ARDUPILOT, {}).result
    assert "for 3 s, which is fixed" in alone_text(ARDUPILOT, {})

"""`stopgo simulate`: simulated vehicles, to try a mission or a ground station against."""

from __future__ import annotations

import typer

from stopgo.bridge.commands.bridge_options import (
    Exact,
    FaultsOfVehicle,
    Insecure,
    ParameterValues,
    Seed,
    SigningKey,
    SimulatedAutopilot,
    SimulatedOrigin,
    SimulatedState,
    SimulatedUrl,
    SpeedUp,
    VehiclePose,
)
from stopgo.bridge.commands.robot_commands import read_pose
from stopgo.bridge.console import say


def simulate_commands() -> typer.Typer:
    """Return `stopgo simulate` with its subcommands."""
    commands = typer.Typer(
        help="Simulate a MAVLink vehicle (a robot of stopgo simulates itself, see stopgo robot)."
        "\n\nExample: stopgo simulate vehicle --autopilot ardupilot --origin 47.4,8.5,400",
    )
    commands.command("vehicle")(simulate_vehicle)
    return commands


def simulate_vehicle(
    *,
    mavlink: SimulatedUrl = "udpin:127.0.0.1:14550",
    profile: SimulatedAutopilot = "strict",
    state: SimulatedState = None,
    origin: SimulatedOrigin = None,
    at: VehiclePose = None,
    fault: FaultsOfVehicle = None,
    exact: Exact = False,
    seed: Seed = 1,
    param: ParameterValues = None,
    speed_up: SpeedUp = 1.0,
    signing_key: SigningKey = None,
    insecure: Insecure = False,
) -> None:
    """Simulate a rover with an autopilot that speaks MAVLink, until SIGTERM.

    Example: stopgo simulate vehicle --mavlink udpin:127.0.0.1:14550 --autopilot ardupilot --origin 47,8,400
    """
    from stopgo.bridge.mavlink.simulated.vehicle_process import VehicleOptions, run_vehicle

    options = VehicleOptions(
        mavlink, profile=profile, state=state, speed_up=speed_up, signing_key=signing_key, insecure=insecure,
        origin=origin, at=None if at is None else read_pose("--at", at), faults=tuple(fault or ()),
        seed=None if exact else seed, parameters=tuple(param or ()),
    )  # fmt: skip
    run_vehicle(options, ready=lambda url: say(f"ready vehicle ({profile}) at {url}"))

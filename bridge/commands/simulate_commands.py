"""`stopgo simulate`: what exists only as numbers, to try a mission or a ground station against."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stopgo.bridge.commands.connection import Insecure, SigningKey
from stopgo.bridge.commands.robot_commands import read_pose
from stopgo.bridge.console import say


def simulate_commands() -> typer.Typer:
    """`stopgo simulate` with its verbs."""
    commands = typer.Typer(
        help="Simulate a MAVLink vehicle (a robot of stopgo simulates itself, see stopgo robot)."
        "\n\nExample: stopgo simulate vehicle --profile ardupilot --origin 47.4,8.5,400",
    )
    commands.command("vehicle")(simulate_vehicle)
    return commands


def simulate_vehicle(
    *,
    mavlink: Annotated[
        str, typer.Option("--mavlink", metavar="URL", help="Where it listens, or the station it speaks to.")
    ] = "udpin:127.0.0.1:14550",
    profile: Annotated[
        str, typer.Option(metavar="strict|ardupilot|px4", help="The autopilot whose habits it has.")
    ] = "strict",
    state: Annotated[
        Path | None, typer.Option("--state", metavar="DIR", help="Where it keeps its items and its place.")
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON,ALT[,HEADING]", help="Its global origin from the start."),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y,HEADING", help="Where it stands in the site's frame."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@N[=AMOUNT]", help="Let something go wrong, as nack@3."),
    ] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="It stands at every place to the last digit, as no real one does.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Of all that is left to chance.")] = 1,
    param: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="NAME=VALUE", help="Set one of its parameters, as WP_RADIUS=0.1."),
    ] = None,
    speed_up: Annotated[
        float, typer.Option("--speed-up", min=0.01, max=1000, help="How much faster its own time runs.")
    ] = 1.0,
    signing_key: SigningKey = None,
    insecure: Insecure = False,
) -> None:
    """Be a rover that speaks MAVLink as an autopilot does, until SIGTERM.

    Example: stopgo simulate vehicle --mavlink udpin:127.0.0.1:14550 --profile ardupilot --origin 47.4,8.5,400
    """
    from stopgo.bridge.mavlink.simulated.vehicle_process import VehicleOptions, run_vehicle

    options = VehicleOptions(
        mavlink, profile=profile, state=state, speed_up=speed_up, signing_key=signing_key, insecure=insecure,
        origin=origin, at=None if at is None else read_pose("--at", at), faults=tuple(fault or ()),
        seed=None if exact else seed, parameters=tuple(param or ()),
    )  # fmt: skip
    run_vehicle(options, ready=lambda url: say(f"ready vehicle ({profile}) at {url}"))

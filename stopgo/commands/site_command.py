"""`stopgo site`: one page in a browser, to plan, push, watch, stop and review."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated, Any

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    As,
    Connect,
    Insecure,
    KeyFolder,
    Roster,
    SiteName,
    Timeout,
)
from stopgo.bridge.commands.connection import given_options, with_presets
from stopgo.bridge.station.roster import (
    RosterVehicle,
    default_sightings_file,
    read_roster,
    read_roster_vehicles,
    read_sightings,
)
from stopgo.mission.console.process import wait_for
from stopgo.mission.console.table import printable

PAGES = "Pages"
EXAMPLE = "Example: stopgo site recordings --connect tcp/127.0.0.1:7447"

PageFolder = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="The site's floors, plans and recordings.")
]
ListenAddress = Annotated[
    str,
    typer.Option(
        "--listen",
        metavar="ADDRESS",
        rich_help_panel=PAGES,
        help="Address of this machine for other devices, over TLS; else this machine alone.",
    ),
]
PageVehicles = Annotated[
    list[str] | None,
    typer.Option(
        "--mavlink",
        metavar="URL",
        help="A vehicle that drives its own list, too; repeatable. --roster gives them names.",
    ),
]
PagePort = Annotated[
    int | None, typer.Option("--port", rich_help_panel=PAGES, help="Port of the pages; else a free one.")
]
Certificate = Annotated[
    Path | None,
    typer.Option("--certificate", metavar="PEM", rich_help_panel=PAGES, help="TLS certificate of the pages."),
]
CertificateKey = Annotated[
    Path | None,
    typer.Option(
        "--certificate-key", metavar="PEM", rich_help_panel=PAGES, help="Private key of --certificate."
    ),
]


def add_commands(app: typer.Typer) -> None:
    """Add the command to `stopgo`."""
    app.command(epilog=EXAMPLE)(site)


def site(
    context: typer.Context,
    folder: PageFolder = Path(),
    *,
    connect: Connect = DEFAULT_ENDPOINT,
    prefix: SiteName = None,
    who: As = None,
    keys: KeyFolder = None,
    insecure: Insecure = False,
    timeout: Timeout = 5.0,
    roster: Roster = None,
    mavlink: PageVehicles = None,
    listen: ListenAddress = "127.0.0.1",
    port: PagePort = None,
    certificate: Certificate = None,
    certificate_key: CertificateKey = None,
) -> None:
    """Serve one page to plan, push, watch, stop and review, until Ctrl-C.

    It prints the address of the page with a token that admits one browser. The robots go on when this
    command ends. Started again, it continues with the same browsers, and shows what they missed.
    """
    from stopgo.site.web_server import SiteOptions, serving_site

    given = {"connect": connect, "site": prefix, "who": who, "keys": keys}
    named = with_presets(given_options(context), given)
    options = SiteOptions(
        folder, named["connect"], named["site"], named["who"], named["keys"], insecure, timeout,
        _expected(named, roster), _vehicles(mavlink, roster), listen, port, certificate, certificate_key,
    )  # fmt: skip

    def say(line: str) -> None:
        typer.echo(printable(line), err=True)

    with serving_site(options, say=say) as address:
        typer.echo(f"{printable(str(folder))}: {address}")
        typer.echo(
            "open it in a browser; it admits one, once. Ctrl-C ends the page, not the robots", err=True
        )
        wait_for(threading.Event())


def _expected(named: dict[str, Any], roster: Path | None) -> tuple[str, ...]:
    """Return the robots that are shown before they are found."""
    if roster is not None:
        return read_roster(roster)
    return tuple(read_sightings(default_sightings_file(named["connect"], named["site"])))


def _vehicles(urls: list[str] | None, roster: Path | None) -> dict[str, RosterVehicle]:
    """Return the vehicles of the roster, and those of URLs, which have numbers for names."""
    named = {} if roster is None else read_roster_vehicles(roster)
    known = {vehicle.mavlink for vehicle in named.values()}
    more = [url for url in urls or [] if url not in known]
    return {**named, **{f"vehicle-{k}": RosterVehicle(mavlink=url) for k, url in enumerate(more, 1)}}

"""`stopgo keys`: makes a site's keys, issues them, and lists who holds some."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bridge.console import print_json, tell
from mission.errors import InputError

SiteFolder = Annotated[Path, typer.Option("--in", metavar="DIR", help="The site's folder of keys.")]


def key_commands() -> typer.Typer:
    """`stopgo keys` with its verbs."""
    commands = typer.Typer(
        help="Make a site's keys: an authority, and a certificate for every station, viewer and robot."
        "\n\nExample: stopgo keys init site-keys && stopgo keys issue robot r1 --in site-keys",
    )
    commands.command("init")(keys_init)
    commands.command("issue")(keys_issue)
    commands.command("show")(keys_show)
    return commands


def keys_init(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")]) -> None:
    """Make a site's authority; whoever has its folder can issue keys, so keep it off the robots.

    Example: stopgo keys init site-keys
    """
    from bridge.link.keys import AUTHORITY, init_site, now_utc

    init_site(folder, now=now_utc())
    tell(f"{folder / AUTHORITY}: the site's authority; keep it away from robots and stations")


def keys_issue(
    role: Annotated[str, typer.Argument(help="station, viewer or robot.")],
    name: Annotated[str, typer.Argument(help="Who it is for; for a robot, its --name.")],
    *,
    folder: SiteFolder,
    days: Annotated[int, typer.Option(min=1, max=825, help="How long they are valid.")] = 90,
) -> None:
    """Issue keys to a station, a viewer or a robot.

    Example: stopgo keys issue station alice --in site-keys
    """
    from bridge.link.keys import ROLES, issue, now_utc

    if role not in ROLES:
        raise InputError(f"role {role!r}: one of {', '.join(ROLES)}")
    files = issue(folder, role, name, now=now_utc(), days=days)
    tell(f"{files.folder}: keys of {role} {name} for {days} days; give it the folder as --keys")


def keys_show(
    site: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="The site's folder of keys.", show_default=False)
    ] = None,
    *,
    folder: Annotated[Path | None, typer.Option("--in", metavar="DIR", help="The same.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """List who holds keys, and until when.

    Example: stopgo keys show site-keys
    """
    from bridge.link.keys import holders, now_utc

    given = [path for path in (site, folder) if path is not None]
    if len(given) != 1:
        raise InputError("keys show: name the site's folder of keys once, as in: stopgo keys show site-keys")
    found = holders(given[0])
    if json_:
        keys = [{"role": who.role, "name": who.name, "not_after": who.not_after.isoformat()} for who in found]
        print_json({"keys": keys})
        return
    for who in found:
        left = (who.not_after - now_utc()).days
        until = f"until {who.not_after:%Y-%m-%d}, {left} days" if left >= 0 else "expired"
        tell(f"{who.role:8} {who.name:20} {until}")

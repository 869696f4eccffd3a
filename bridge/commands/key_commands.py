"""`stopgo keys`: makes a site's keys, issues, renews and revokes them, and lists who holds some."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from stopgo.bridge.commands.connection import SiteName
from stopgo.bridge.console import print_json, tell, tell_lines
from stopgo.mission.console.table import table
from stopgo.mission.errors import InputError

SiteFolder = Annotated[Path, typer.Option("--in", metavar="DIR", help="The site's folder of keys.")]
Days = Annotated[int, typer.Option(min=1, max=825, help="How long they are valid.")]
Addresses = Annotated[
    list[str] | None,
    typer.Option(
        "--address", metavar="ADDRESS",
        help="Where a robot or router is reached, besides this machine: an IP address or a name; repeatable.",
    ),
]  # fmt: skip
OUT_OF_DATE = "copy revoked.json from it to every machine's folder of keys: there it counts at once"


def key_commands() -> typer.Typer:
    """`stopgo keys` with its verbs."""
    commands = typer.Typer(
        help="Make a site's keys: an authority, and a certificate for each station, viewer, robot and router."
        "\n\nExample: stopgo keys init site-keys && stopgo keys issue robot r1 --in site-keys",
    )
    commands.command("init")(keys_init)
    commands.command("issue")(keys_issue)
    commands.command("list")(keys_list)
    commands.command("rotate")(keys_rotate)
    commands.command("revoke")(keys_revoke)
    commands.command("router-rules")(router_rules)
    return commands


def keys_init(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")]) -> None:
    """Make a site's authority; whoever has its folder can issue keys, so keep it off the robots.

    Example: stopgo keys init site-keys
    """
    from stopgo.bridge.link.authority import AUTHORITY, init_site
    from stopgo.bridge.link.keys import now_utc

    init_site(folder, now=now_utc())
    tell(f"{folder / AUTHORITY}: the site's authority; keep it away from robots and stations")


def keys_issue(
    role: Annotated[str, typer.Argument(help="station, viewer, robot or router.")],
    name: Annotated[str, typer.Argument(help="Who it is for; for a robot, its --name.")],
    *,
    folder: SiteFolder,
    days: Days = 90,
    address: Addresses = None,
) -> None:
    """Issue keys to a station, a viewer, a robot or a router.

    Example: stopgo keys issue robot r1 --address 10.1.2.3 --in site-keys
    """
    from stopgo.bridge.link.authority import issue
    from stopgo.bridge.link.keys import ROLES, now_utc

    known = next((one for one in ROLES if one == role), None)
    if known is None:
        raise InputError(f"role {role!r}: one of {', '.join(ROLES)}")
    files = issue(folder, known, name, now=now_utc(), days=days, addresses=tuple(address or ()))
    tell(f"{files.folder}: keys of {role} {name} for {days} days; give it the folder as --keys")


def keys_rotate(
    name: Annotated[str, typer.Argument(help="Who gets new keys.")],
    *,
    folder: SiteFolder,
    days: Days = 90,
    address: Addresses = None,
) -> None:
    """Issue new keys to one who has some; the old ones count until they end, or are revoked.

    Example: stopgo keys rotate r1 --in site-keys
    """
    from stopgo.bridge.link.authority import rotate
    from stopgo.bridge.link.keys import now_utc

    files = rotate(folder, name, now=now_utc(), days=days, addresses=tuple(address or ()))
    tell(
        f"{files.folder}: new keys of {name} for {days} days; give it the folder, then let the old ones go:"
        f" stopgo keys revoke {name} --old --in {folder}"
    )


def keys_revoke(
    name: Annotated[str, typer.Argument(help="Whose keys count no more.")],
    *,
    folder: SiteFolder,
    old: Annotated[bool, typer.Option("--old", help="Only those that were replaced.")] = False,
) -> None:
    """Let keys count no more: the list of them goes into every folder, to be copied to the machines.

    Example: stopgo keys revoke alice --in site-keys
    """
    from stopgo.bridge.link.authority import revoke

    serials = revoke(folder, name, old=old)
    if serials:
        tell(f"{name}: {len(serials)} revoked ({', '.join(serial[:8] for serial in serials)}); {OUT_OF_DATE}")
    else:
        tell(f"{name}: nothing to revoke that was not revoked before")


def keys_list(
    site: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="The site's folder of keys.", show_default=False)
    ] = None,
    *,
    folder: Annotated[Path | None, typer.Option("--in", metavar="DIR", help="The same.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """List every key that was issued: to whom, until when, and whether it counts.

    Example: stopgo keys list site-keys
    """
    from stopgo.bridge.link.authority import listed
    from stopgo.bridge.link.keys import now_utc

    given = [path for path in (site, folder) if path is not None]
    if len(given) != 1:
        raise InputError("keys list: name the site's folder of keys once, as in: stopgo keys list site-keys")
    found = listed(given[0], now=now_utc())
    if json_:
        print_json({"keys": [
            {"role": one.holder.role, "name": one.holder.name, "serial": one.holder.serial,
             "not_after": one.holder.not_after.isoformat(), "state": one.state, "current": one.current}
            for one in found
        ]})  # fmt: skip
        return
    rows = [
        (one.holder.role, one.holder.name, one.holder.serial[:8], f"{one.holder.not_after:%Y-%m-%d}",
         one.state if one.current else f"{one.state}, replaced")
        for one in found
    ]  # fmt: skip
    tell_lines(table(("role", "name", "serial", "until", "state"), rows))


def router_rules(
    *,
    folder: SiteFolder,
    site: SiteName = None,
) -> None:
    """Print a zenoh router's access control: each robot on its own keys only, each holder by its role.

    Only those whose keys count are in it; print it anew when keys were issued or revoked.

    Example: stopgo keys router-rules --in site-keys --site north > access_control.json
    """
    from stopgo.bridge.link.access import router_access_control
    from stopgo.bridge.link.authority import listed
    from stopgo.bridge.link.keys import now_utc

    valid = [one.holder for one in listed(folder, now=now_utc()) if one.state == "valid"]
    tell_lines(json.dumps({"access_control": router_access_control(valid, site)}, indent=2))

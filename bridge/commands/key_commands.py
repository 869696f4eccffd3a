"""`stopgo keys`: creates a site's authority; issues, renews, revokes and lists keys."""

from __future__ import annotations

import json

import typer

from stopgo.bridge.commands.bridge_options import (
    Addresses,
    AnySiteFolder,
    Days,
    HolderName,
    Json,
    KeyRole,
    NewFolder,
    OnlyReplaced,
    SiteFolder,
    SiteFolderArgument,
    SiteName,
)
from stopgo.bridge.console import print_json, print_line, print_text
from stopgo.mission.console.table import table
from stopgo.mission.errors import InputError

COPY_REVOKED = "copy revoked.json from it to every machine's folder of keys, where it takes effect at once"


def key_commands() -> typer.Typer:
    """Return `stopgo keys` with its subcommands."""
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


def keys_init(folder: NewFolder) -> None:
    """Create a site's authority; its folder can issue keys, so keep it off the robots.

    Example: stopgo keys init site-keys
    """
    from stopgo.bridge.link.authority import AUTHORITY, init_site
    from stopgo.bridge.link.keys import now_utc

    init_site(folder, now=now_utc())
    print_line(f"{folder / AUTHORITY}: the site's authority; keep it away from robots and stations")


def keys_issue(
    role: KeyRole,
    name: HolderName,
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
    print_line(f"{files.folder}: keys of {role} {name} for {days} days; give it the folder as --keys")


def keys_rotate(
    name: HolderName,
    *,
    folder: SiteFolder,
    days: Days = 90,
    address: Addresses = None,
) -> None:
    """Issue new keys to a holder; the old ones stay valid until they expire or are revoked.

    Example: stopgo keys rotate r1 --in site-keys
    """
    from stopgo.bridge.link.authority import rotate
    from stopgo.bridge.link.keys import now_utc

    files = rotate(folder, name, now=now_utc(), days=days, addresses=tuple(address or ()))
    print_line(
        f"{files.folder}: new keys of {name} for {days} days; give it the folder, then revoke the old ones:"
        f" stopgo keys revoke {name} --old --in {folder}"
    )


def keys_revoke(
    name: HolderName,
    *,
    folder: SiteFolder,
    old: OnlyReplaced = False,
) -> None:
    """Revoke keys: they are listed in every folder of keys, to be copied to the machines.

    Example: stopgo keys revoke alice --in site-keys
    """
    from stopgo.bridge.link.authority import revoke

    serials = revoke(folder, name, old=old)
    if serials:
        print_line(
            f"{name}: {len(serials)} revoked ({', '.join(serial[:8] for serial in serials)}); {COPY_REVOKED}"
        )
    else:
        print_line(f"{name}: nothing to revoke; all its keys were revoked before")


def keys_list(
    site: SiteFolderArgument = None,
    *,
    folder: AnySiteFolder = None,
    json_: Json = False,
) -> None:
    """List every key that was issued: its holder, its expiry, and its state.

    Example: stopgo keys list site-keys
    """
    from stopgo.bridge.link.authority import listed
    from stopgo.bridge.link.keys import now_utc

    given = [path for path in (site, folder) if path is not None]
    if len(given) != 1:
        raise InputError(
            "keys list: needs one folder of keys; write it once, as in stopgo keys list site-keys"
        )
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
    print_text(table(("role", "name", "serial", "until", "state"), rows))


def router_rules(
    *,
    folder: SiteFolder,
    site: SiteName = None,
) -> None:
    """Print a zenoh router's access control: robots by their key expressions, other holders by their roles.

    It contains holders of valid keys only; print it again after keys were issued or revoked.

    Example: stopgo keys router-rules --in site-keys --site north > access_control.json
    """
    from stopgo.bridge.link.access import router_access_control
    from stopgo.bridge.link.authority import listed
    from stopgo.bridge.link.keys import now_utc

    valid = [one.holder for one in listed(folder, now=now_utc()) if one.state == "valid"]
    print_text(json.dumps({"access_control": router_access_control(valid, site)}, indent=2))

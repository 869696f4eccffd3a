"""`stopgo session`: holds a session to a robot open, which the commands of the same user share."""

from __future__ import annotations

from stopgo.bridge.commands.connection import Connection, reached, session_options, with_connection
from stopgo.bridge.console import print_line
from stopgo.mission.errors import NegativeResult


@with_connection(without=("mavlink", "vehicle", "signing_key", "state"))
def session(connection: Connection) -> None:
    """Hold a session to the robot open until Ctrl-C; commands with the same options share it.

    A command then needs no session of its own: pause takes one round trip to the robot. It waits for this
    process for 0.2 s at most, and opens a session of its own if there is no answer. Only commands of the
    same user with the same options (robot, endpoint, keys) share it.

    Example: stopgo session --robot r1 --connect tcp/127.0.0.1:7447
    """
    from stopgo.bridge.station.shared_session import SharedSession, listening_at

    with listening_at(session_options(connection).path) as listener, reached(connection) as station:
        if station.held is not None and station.held.holder.role != "station":
            raise NegativeResult(f"session: {station.commander} is a viewer; sessions are for stations")
        shared = SharedSession(station.link, token=station.keys.alive, commander=station.commander)
        print_line(f"{connection.robot}: session open; Ctrl-C ends it", flush=True)
        shared.serve(listener)

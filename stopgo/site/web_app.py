"""The site's web application: its routes, each a few lines above the room that does the work.

Handlers that wait for a file or a process run on threads; orders wait without one, so that a stop is never
behind anything. Every answer is JSON, a file of the page, or one document that runs nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import PurePosixPath
from typing import TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError, NegativeResult, StopgoError
from stopgo.mission.files.mission_json import read
from stopgo.site.event_feed import EventFeed
from stopgo.site.known_missions import KnownMissions
from stopgo.site.live_robot import LiveRobot
from stopgo.site.page_access import SESSION_S, PageAccess, PageRole
from stopgo.site.request_checks import RequestChecks, SiteAddress
from stopgo.site.robot_orders import (
    OrderRecord,
    OrderRequest,
    PushRequest,
    RobotOrders,
    StopRequest,
    records_json,
)
from stopgo.site.site_folder import SiteFiles, mission_difference

M = TypeVar("M", bound=msgspec.Struct)
PAGE_FILES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
Handler = Callable[[Request], Awaitable[Response] | Response]


class SignIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A one-time token for a session."""

    token: str


class Invitation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request for a link by which another device signs in."""

    role: PageRole


@dataclass
class SiteParts:
    """Everything that the routes work with."""

    address: SiteAddress
    access: PageAccess
    feed: EventFeed
    folder: SiteFiles
    missions: KnownMissions
    robots: Mapping[str, LiveRobot]
    orders: RobotOrders
    commander: str
    may_command: bool = True
    """False if the keys are a viewer's: no page may order anything."""
    ended: Callable[[], bool] = lambda: False
    viewer: Callable[[], str] = lambda: ""
    """Returns the origin of Rerun's viewer."""
    more: list[Route] = field(default_factory=list)
    """Routes of planning and of looking back."""


def web_app(parts: SiteParts) -> RequestChecks:
    """Return the application with its checks in front."""
    live = LivePages(parts)
    routes = [
        Route("/", page_file),
        Route("/pages/{name}", page_file),
        Route("/api/session", live.sign_in, methods=["POST"]),
        Route("/api/invitations", live.invite, methods=["POST"]),
        Route("/api/me", live.me),
        Route("/api/events", live.events),
        Route("/api/folder", live.folder),
        Route("/api/missions/{id}/{revision:int}", live.mission),
        Route("/api/stop", live.stop, methods=["POST"]),
        Route("/api/robots/{name}/orders", live.order, methods=["POST"]),
        Route("/api/robots/{name}/push", live.push, methods=["POST"]),
        Route("/api/robots/{name}/difference", live.difference),
        *parts.more,
    ]

    def refused(request: Request, error: Exception) -> Response:
        """Answer a request that cannot be carried out with the error's one line."""
        status = 409 if isinstance(error, NegativeResult) else 400
        return JSONResponse({"error": parts.folder.plain(str(error))}, status_code=status)

    def failed(request: Request, error: Exception) -> Response:
        """Answer a request that the disk has refused, such as a full or a read-only one."""
        assert isinstance(error, OSError)
        where, why = error.filename or "the site's disk", error.strerror or error
        text = f"{where}: {why}; make room, or let the site write there, and try again"
        return JSONResponse({"error": parts.folder.plain(text)}, status_code=400)

    app = Starlette(routes=routes, exception_handlers={StopgoError: refused, OSError: failed})
    return RequestChecks(app, address=parts.address, access=parts.access, viewer=parts.viewer)


def page_file(request: Request) -> Response:
    """Return a file of the page; their names are fixed, so no path leads elsewhere."""
    name = request.path_params.get("name", "index.html")
    kind = PAGE_FILES.get(PurePosixPath(name).suffix)
    known = {one.name: one for one in files("stopgo.site").joinpath("pages").iterdir()}
    if kind is None or name not in known:
        return JSONResponse({"error": "not found"}, status_code=404)
    return Response(known[name].read_bytes(), media_type=kind)


async def body_of(request: Request, kind: type[M]) -> M:
    """Return the body of a request; raises `InputError` if it is something else."""
    try:
        return decoded(await request.body(), kind)
    except msgspec.DecodeError as error:
        raise InputError(f"the request cannot be read: {error}") from None


class LivePages:
    """Routes of the live floor, orders and access."""

    def __init__(self, parts: SiteParts) -> None:
        self._parts = parts

    async def sign_in(self, request: Request) -> Response:
        """Open a session with a one-time token."""
        made = self._parts.access.redeem((await body_of(request, SignIn)).token)
        if made is None:
            return JSONResponse({"error": "this address was used already, or is too old"}, status_code=401)
        answer = JSONResponse({"key": made.key, "role": made.role})
        answer.set_cookie(
            self._parts.address.cookie, made.cookie, max_age=round(SESSION_S), httponly=True,
            samesite="strict", secure=self._parts.address.scheme == "https", path="/",
        )  # fmt: skip
        return answer

    async def invite(self, request: Request) -> Response:
        """Return an address by which another device signs in once."""
        token = self._parts.access.invite((await body_of(request, Invitation)).role)
        return JSONResponse({"address": f"{self._parts.address.url}/#token={token}"})

    async def me(self, request: Request) -> Response:
        """Return who the page is, and what it may do."""
        role = request.scope["session_of_page"].role
        return JSONResponse({
            "role": role if self._parts.may_command else "viewer",
            "commander": self._parts.commander,
            "folder": self._parts.folder.root.name,
            "robots": sorted(self._parts.robots),
        })  # fmt: skip

    async def events(self, request: Request) -> Response:
        """Stream everything that the page shows, after the last message that it knows."""
        last = request.headers.get("last-event-id") or request.query_params.get("last", "")

        async def stream() -> AsyncIterator[bytes]:
            async for message in self._parts.feed.messages(last, ended=self._parts.ended):
                yield message

        return StreamingResponse(stream(), media_type="text/event-stream")

    def folder(self, request: Request) -> Response:
        """Return the floors and the missions of the folder."""
        folder = self._parts.folder
        missions, left = folder.missions()
        return JSONResponse({"floors": folder.floors(), "missions": missions, "left": left})

    def mission(self, request: Request) -> Response:
        """Return the drawing of a mission that a robot holds."""
        known = self._parts.missions.get(request.path_params["id"], request.path_params["revision"])
        if known is None:
            return JSONResponse({"error": "not found"}, status_code=404)
        return JSONResponse(known.drawing)

    async def stop(self, request: Request) -> Response:
        """Stop robots: sent at once, answered when each has answered or the time is up."""
        self._must_command()
        begun = self._parts.orders.stop(await body_of(request, StopRequest))
        return JSONResponse({"orders": records_json(await _all(begun))})

    async def order(self, request: Request) -> Response:
        """Send an order to a robot."""
        self._must_command()
        given = await body_of(request, OrderRequest)
        begun = self._parts.orders.order(request.path_params["name"], given)
        return JSONResponse({"orders": records_json(await _all([begun]))})

    async def push(self, request: Request) -> Response:
        """Send a mission of the folder to a robot."""
        self._must_command()
        given = await body_of(request, PushRequest)
        mission = await asyncio.to_thread(lambda: read(self._parts.folder.file(given.file)))
        begun = self._parts.orders.push(request.path_params["name"], given, mission)
        return JSONResponse({"orders": records_json(await _all([begun]))})

    def difference(self, request: Request) -> Response:
        """Return what a push would change."""
        robot = self._parts.orders.robot(request.path_params["name"])
        mission = read(self._parts.folder.file(request.query_params.get("file", "")))
        return JSONResponse(mission_difference(robot.held.mission, mission) | {"known": robot.held.is_known})

    def _must_command(self) -> None:
        if not self._parts.may_command:
            raise NegativeResult("the keys of this site are a viewer's; only stations may send commands")


async def _all(begun: list[Future[OrderRecord]]) -> list[OrderRecord]:
    return list(await asyncio.gather(*(asyncio.wrap_future(one) for one in begun)))

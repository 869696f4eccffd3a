"""Routes of looking back: list, reports, recordings, downloads and follow-up missions."""

from __future__ import annotations

import asyncio
from urllib.parse import quote

import msgspec
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from stopgo.site.request_checks import DOCUMENT_POLICY
from stopgo.site.run_pages import PageDownload, RunRoom
from stopgo.site.web_app import body_of
from stopgo.site.web_viewer import WebViewer

RESOURCES = "Cross-Origin-Resource-Policy"


class MissionKey(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mission of the list, by its key."""

    key: str


def run_routes(room: RunRoom, viewer: WebViewer, address: str) -> list[Route]:
    """Return the routes of looking back; `address` is the site's."""

    def listed(request: Request) -> Response:
        return JSONResponse(room.listed())

    def report(request: Request) -> Response:
        page = room.report(request.path_params["key"])
        return Response(page, media_type="text/html", headers={"Content-Security-Policy": DOCUMENT_POLICY})

    def open_recording(key: str) -> str:
        return viewer.showing(f"{address}/recordings/{room.open_recording(key)}.rrd")

    async def open_viewer(request: Request) -> Response:
        key = (await body_of(request, MissionKey)).key
        return JSONResponse({"address": await asyncio.to_thread(open_recording, key)})

    def recording(request: Request) -> Response:
        body = room.recording_of_secret(request.path_params["secret"])
        allowed = {"Access-Control-Allow-Origin": viewer.origin, RESOURCES: "cross-origin"}
        return Response(body, media_type="application/octet-stream", headers=allowed)

    def download(request: Request) -> Response:
        return file_answer(
            room.download(request.query_params.get("file", ""), request.query_params.get("to", ""))
        )

    async def follow_up(request: Request) -> Response:
        given = await body_of(request, MissionKey)
        return JSONResponse(await asyncio.to_thread(room.follow_up, given.key))

    return [
        Route("/api/runs", listed),
        Route("/reports/{key}", report),
        Route("/api/viewer", open_viewer, methods=["POST"]),
        Route("/recordings/{secret}.rrd", recording),
        Route("/downloads", download),
        Route("/api/follow-ups", follow_up, methods=["POST"]),
    ]


def file_answer(made: PageDownload) -> Response:
    """Return a file that the browser saves."""
    headers = {
        "Content-Disposition": f"attachment; filename*=UTF-8''{quote(made.name)}",
        "Content-Security-Policy": DOCUMENT_POLICY,
    }
    return Response(made.body, media_type=made.kind, headers=headers)

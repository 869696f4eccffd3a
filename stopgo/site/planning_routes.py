"""Routes of planning: read a floor, begin, follow, cancel and save a variant."""

from __future__ import annotations

import asyncio

import msgspec
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from stopgo.mission.errors import InputError
from stopgo.mission.settings import PARAMETERS
from stopgo.site.planning import EditRequest, PlanningRoom, VariantRequest
from stopgo.site.web_app import body_of

OPTIONS = (
    "storey", "date", "targets", "coverage", "range", "scanner", "clearance", "robot_radius", "start", "tour",
    "register", "min_views",
)  # fmt: skip
"""The twelve options of the page that people use most, by their names in plan.toml."""
FOR_AUTOPILOTS = ("origin",)
"""Options without which no autopilot takes a mission, unless the floor's file has them."""


class FloorRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A floor to read, with the options of its reader."""

    floor: str
    options: dict[str, str] = {}


class SaveRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A name in the folder for a variant."""

    name: str


def planning_routes(room: PlanningRoom) -> list[Route]:
    """Return the routes of planning."""

    async def read_floor(request: Request) -> Response:
        given = await body_of(request, FloorRequest)
        return JSONResponse(await asyncio.to_thread(room.read, given.floor, given.options))

    async def begin(request: Request) -> Response:
        given = await body_of(request, VariantRequest)
        return JSONResponse({"number": await asyncio.to_thread(room.plan, given)})

    async def edit(request: Request) -> Response:
        given = await body_of(request, EditRequest)
        return JSONResponse(await asyncio.to_thread(room.edit, request.path_params["number"], given))

    async def cancel(request: Request) -> Response:
        room.cancel(request.path_params["number"])
        return JSONResponse({})

    async def save(request: Request) -> Response:
        given = await body_of(request, SaveRequest)
        return JSONResponse(
            {"file": await asyncio.to_thread(room.save, request.path_params["number"], given.name)}
        )

    def drawing(request: Request) -> Response:
        return JSONResponse(room.drawing(request.path_params["number"]))

    return [
        Route("/api/plan-options", lambda request: JSONResponse({"options": options_json()})),
        Route("/api/floors", read_floor, methods=["POST"]),
        Route("/api/plans", begin, methods=["POST"]),
        Route("/api/plans/{number:int}/drawing", drawing),
        Route("/api/plans/{number:int}/edit", edit, methods=["POST"]),
        Route("/api/plans/{number:int}/cancel", cancel, methods=["POST"]),
        Route("/api/plans/{number:int}/save", save, methods=["POST"]),
    ]


def options_json() -> list[dict[str, object]]:
    """Return the options of the page, as their declarations have them."""
    by_key = {parameter.key: parameter for parameter in PARAMETERS.values()}
    shown = (*OPTIONS, *FOR_AUTOPILOTS)
    missing = [key for key in shown if key not in by_key]
    if missing:
        raise InputError(f"no such options: {', '.join(missing)}")
    return [
        {
            "key": key, "help": by_key[key].help, "unit": by_key[key].unit, "form": by_key[key].form,
            "choices": by_key[key].choices, "flag": by_key[key].plain is bool,
            "default": _shown(by_key[key].default), "undecided": by_key[key].undecided,
        }
        for key in shown
    ]  # fmt: skip


def _shown(value: object) -> str:
    if value is None or value == ():
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)

"""The site in the tests' own process: its application without a socket, and a page that has signed in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from stopgo.site.event_feed import EventFeed
from stopgo.site.known_missions import KnownMissions
from stopgo.site.live_robot import LiveRobot
from stopgo.site.page_access import PageAccess, PageRole
from stopgo.site.request_checks import KEY_HEADER, SiteAddress
from stopgo.site.robot_orders import RobotOrders
from stopgo.site.site_folder import SiteFiles
from stopgo.site.web_app import SiteParts, web_app

HOST = "127.0.0.1:26000"
URL = f"http://{HOST}"
ADDRESS = SiteAddress("http", (HOST, "localhost:26000"))


def parts_of(folder: Path, **changes: Any) -> SiteParts:
    """Everything of a site in a folder, without robots unless they are given."""
    place = folder / "site"
    place.mkdir(exist_ok=True)
    feed, robots = EventFeed(), dict[str, LiveRobot]()
    given = {
        "address": ADDRESS, "access": PageAccess(folder / "state" / "access.json", 26000), "feed": feed,
        "folder": SiteFiles.at(place), "missions": KnownMissions(place), "robots": robots,
        "orders": RobotOrders(robots, feed), "commander": "anna@site",
    }  # fmt: skip
    return SiteParts(**{**given, **changes})


class Page:
    """A browser's page: it keeps the cookie and the key, and names its origin as browsers do."""

    def __init__(self, parts: SiteParts, role: PageRole | None = "operator") -> None:
        self.client = TestClient(web_app(parts), base_url=URL, raise_server_exceptions=False)
        self.key = ""
        if role is not None:
            self.sign_in(parts.access.invite(role))

    def sign_in(self, token: str) -> int:
        answer = self.post("/api/session", {"token": token})
        self.key = answer.json().get("key", "")
        return int(answer.status_code)

    def get(self, path: str, **headers: str) -> Any:
        return self.client.get(path, headers=headers)

    def post(self, path: str, body: Any, **headers: str | None) -> Any:
        given: dict[str, str | None] = {"Origin": URL, KEY_HEADER: self.key, **headers}
        kept = {name.replace("_", "-"): value for name, value in given.items() if value is not None}
        return self.client.post(path, json=body, headers=kept)

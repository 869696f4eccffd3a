"""One site for all tests in a browser: robots in memory, the server in this process, and one floor."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.robot.program import RobotOptions, robot_on
from stopgo.bridge.robot.robot_hardware import SimulatedBody
from stopgo.bridge.robot.simulated_faults import read_faults
from stopgo.site.web_server import SiteOptions, serving_site
from tests.ports import free_port
from tests.site.chromium import Browser, Tab
from tests.site.two_rooms import two_rooms

FAST, AS_REAL = 60.0, 1.0


class BrowserWorld:
    """Robots on a link in memory, and a site that can be ended and started again."""

    def __init__(self, place: Path, chromium: Browser) -> None:
        self.chromium = chromium
        self.folder = place / "site"
        self.folder.mkdir()
        two_rooms(self.folder / "house.dxf")
        self.board = Switchboard()
        self.port = free_port()
        self._place = place
        self._robots, self._site = ExitStack(), ExitStack()
        self.address = ""

    def add_robot(self, name: str, speed_up: float, *faults: str) -> None:
        state = self._place / name
        body = SimulatedBody(state, faults=read_faults(faults))
        options = RobotOptions(name=name, listen="", state=state, body=body, speed_up=speed_up)
        self._robots.enter_context(robot_on(self.board.link(), KeyExpressions(name), options))

    def start_site(self) -> None:
        self.address = self._site.enter_context(self.site("anna", self.port))

    def end_site(self) -> None:
        self._site.close()

    @contextmanager
    def site(self, commander: str, port: int) -> Iterator[str]:
        """A site on the same link and folder, with its address."""
        options = SiteOptions(
            self.folder, "", commander=commander, robots=("r1", "r2"), port=port, timeout_s=1.0
        )
        with serving_site(options, say=lambda line: None, link=self.board.link()) as address:
            yield address

    def close(self) -> None:
        self._site.close()
        self._robots.close()

    @property
    def own(self) -> str:
        return self.address.partition("#")[0]

    @contextmanager
    def tab(self, hash_: str = "") -> Iterator[Tab]:
        """A tab of the browser, which has signed in before; it must report no error."""
        tab = self.chromium.tab(f"{self.own}{hash_}")
        tab.until("document.getElementById('stop')")
        try:
            yield tab
            assert tab.problems == []
            assert [one for one in tab.requested if not one.startswith((self.own, "data:"))] == []
        finally:
            tab.close()


def card(robot: str, rest: str = "") -> str:
    """Selector of a robot's card, or of something in it."""
    return f'[aria-label="Robot {robot}"] {rest}'.strip()


def state_is(tab: Tab, robot: str, *words: str) -> None:
    """Wait until a robot's card has one of the states."""
    tab.until(f"{list(words)}.includes(document.querySelector('{card(robot, '.state')}')?.textContent)")


def plan_on_page(tab: Tab) -> None:
    """Plan the only floor of the folder, and save the plan."""
    tab.run("location.hash = '#plan'")
    tab.shows("32 m², 2 rooms, 1 openings")
    tab.press("Plan")
    tab.press("Save")
    tab.shows("Saved as plans/house/mission.json")


def push_on_page(tab: Tab, robot: str, difference: str, *, file: str = "plans/house/mission.json") -> None:
    """Push a mission of the folder to a robot, after its difference was shown."""
    tab.run("location.hash = '#live'")
    state_is(tab, robot, "idle", "ready", "finished", "paused", "aborted")
    tab.press("Push mission", card(robot, "button"))
    tab.until(f"document.querySelector('.question option[value=\"{file}\"]')")
    tab.run(f"{{ const list = document.querySelector('.question select'); list.value = '{file}';"
            " list.dispatchEvent(new Event('change')); }")  # fmt: skip
    tab.shows(difference, card(robot, ".difference"))
    tab.press(f"Push to {robot}", card(robot, "button"))
    tab.shows(f"{'house-top-up' if 'follow-up' in file else 'house'} revision 1: 0 of", card(robot))
    state_is(tab, robot, "ready")

"""A site engineer's day in a real browser: after the first command everything is done on the page."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from msgspec import structs

from stopgo.mission.document import with_digest
from stopgo.mission.files.mission_json import read, write
from tests.planner.floors.ifc.house import two_rooms as house_model
from tests.planner.floors.ifc.test_status import WORK, scheduled
from tests.ports import free_port
from tests.site.browser_world import (
    AS_REAL,
    FAST,
    BrowserWorld,
    card,
    plan_on_page,
    push_on_page,
    state_is,
)
from tests.site.chromium import Tab, browser, needs_chromium

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BrowserWorld]:
    """The site with a plan that was made on its page; the first tab has signed in for all."""
    with pytest.MonkeyPatch.context() as patch, browser() as chromium:
        place = tmp_path_factory.mktemp("browser")
        patch.setenv("XDG_STATE_HOME", str(place / "state"))
        patch.setenv("XDG_CACHE_HOME", str(place / "cache"))
        made = BrowserWorld(place, chromium)
        try:
            made.add_robot("r1", FAST, "blocked@2")
            made.add_robot("r2", AS_REAL)
            made.start_site()
            first = chromium.tab(made.address)
            state_is(first, "r1", "idle")
            plan_on_page(first)
            assert first.problems == []
            first.close()
            yield made
        finally:
            made.close()


def test_a_day_from_the_floor_to_the_report(world: BrowserWorld) -> None:
    """Push, start, skip a held stop, finish, read the report, and plan what is missing."""
    with world.tab() as tab:
        push_on_page(tab, "r1", "The robot holds no mission.")
        tab.run(NOTE_ORDERS)
        tab.press("Start", card("r1", "button"))
        tab.shows("Started by anna", ".events")
        state_is(tab, "r1", "HELD")
        tab.shows("HELD: ", card("r1", ".reason"))
        tab.press("Skip stop", card("r1", "button"))
        tab.shows("Leave stop s02 of r1 out?", ".question")
        tab.press("Skip stop", ".question button")
        tab.shows("skipped", ".events")
        start, skip = tab.run("window.orders")
        assert (start["revision"], skip["stop"]) == (1, "s02")
        assert len(start["mission_id"]) == 32 and skip["run_id"]
        state_is(tab, "r1", "finished")
        tab.until("document.querySelectorAll('.map .stop.done').length > 0")
        tab.until("document.querySelectorAll('.map .stop.skipped').length == 1")
        tab.until("document.querySelector('.map .target.lost').getAttribute('d').length > 0")
        tab.run("location.hash = '#back'")
        tab.shows("Report of the run")
        tab.shows("NO", ".missions td")
        report = tab.run("fetch(document.querySelector('a.primary').href).then((one) => one.text())")
        assert "skipped" in report
        tab.press("Plan what is missing")
        tab.shows("1 stops for what is missing: plans/house/follow-up/mission.json")
        follow_up = "plans/house/follow-up/mission.json"
        push_on_page(tab, "r1", "is replaced by another mission", file=follow_up)


NOTE_ORDERS = """{ const real = window.fetch; window.orders = []; window.fetch = (to, given) => {
  if (String(to).endsWith("/orders")) window.orders.push(JSON.parse(given.body));
  return real(to, given); } }"""
"""Keep the orders that the page gives."""


NO_ANSWER = """{ const real = window.fetch; window.fetch = (to, ...rest) => String(to).includes("/api/stop")
  ? real(to, ...rest).then(() => new Promise(() => {})) : real(to, ...rest); }"""
"""The server gets a STOP, and its answer takes for ever: what is known comes by the stream of events."""


SLOW_PAGE_S = 0.5
"""Two presses of a key are handled 1 s apart, as on a busy machine, however fast they were pressed."""


def test_stop_is_sent_heard_and_standing_also_from_the_keyboard(world: BrowserWorld) -> None:
    standing = "/r2: sent .* heard .* standing [0-9]/"
    with world.tab() as tab:
        tab.run("document.getElementById('stop').click()")
        tab.shows("r2: sent", "#stopped")
        push_on_page(tab, "r2", "The robot holds no mission.")
        tab.press("Start", card("r2", "button"))
        state_is(tab, "r2", "running")
        at = time.time()
        for after_s in (-2.0, -1.0, -0.5):  # the first two are too far apart
            for kind in ("keyDown", "keyUp"):
                when = {"timestamp": at + after_s}
                tab.call("Input.dispatchKeyEvent", type=kind, key="Escape", code="Escape", **when)
                time.sleep(SLOW_PAGE_S)
        good = "[...document.querySelectorAll('#stopped .good')]"
        tab.until(f"{good}.some((one) => {standing}.test(one.innerText))")
        state_is(tab, "r2", "paused")
        second_person(world, tab)
        world.board.cut = True
        try:
            tab.until(f"document.querySelector('{card('r2')}').classList.contains('old')")
            tab.run(NO_ANSWER)
            tab.run("document.getElementById('stop').click()")
            tab.shows("UNKNOWN", "#stopped .bad")
            assert "sending" not in tab.run("document.getElementById('stopped').innerText")
            assert tab.run("document.getElementById('stop').disabled") is False
        finally:
            world.board.cut = False
        tab.until(f"!document.querySelector('{card('r2')}').classList.contains('old')")


def second_person(world: BrowserWorld, tab: Tab) -> None:
    """Another person's page names who commands the robot, and asks before it takes over."""
    with world.site("berta", free_port()) as address:
        theirs = world.chromium.tab(address)
        theirs.shows("anna commands it.", card("r2"))
        theirs.press("Resume", card("r2", "button"))
        theirs.shows("anna commands r2. Take it over?", ".question")
        theirs.press("Take over")
        tab.shows("berta commands it.", card("r2"))
        state_is(tab, "r2", "running")
        assert theirs.problems == []
        theirs.close()


def test_a_folder_that_is_gone_is_said_to_be_gone(world: BrowserWorld) -> None:
    """It was shown as a folder without missions."""
    away = world.folder.with_name("away")
    tab = world.chromium.tab(world.own)
    tab.shows("Push mission", card("r1", "button"))
    world.folder.rename(away)
    try:
        tab.press("Push mission", card("r1", "button"))
        tab.shows("the site's folder is not there", card("r1", ".question"))
        tab.run("location.hash = '#plan'")
        tab.shows("the site's folder is not there", "main")
    finally:
        away.rename(world.folder)
        tab.close()


def test_a_server_that_was_away_misses_nothing(world: BrowserWorld) -> None:
    """The run goes on, and the page catches up every event once the server is there again."""
    with world.tab() as tab:
        tab.shows("r1")
        push_on_page(tab, "r1", "")
        tab.press("Start", card("r1", "button"))
        tab.shows("Repeat the whole mission with r1?", ".question")
        tab.press("Start", ".question button")
        tab.press("Start from here", ".question button")
        state_is(tab, "r1", "running", "HELD")
        world.end_site()
        tab.until("!document.getElementById('offline').hidden")
        world.start_site()
        tab.until("document.getElementById('offline').hidden")
        state_is(tab, "r1", "finished", "HELD")
        tab.shows("Finished", ".events")
        listed = "import('/pages/store.js').then((store) => store.all('event', 'r1').map((one) => one.value))"
        events = sorted(tab.run(listed), key=lambda one: int(one["number"]))
        first = events[0]["number"]
        assert [one["number"] for one in events] == list(range(first, first + len(events)))
        assert (events[0]["event"], events[-1]["event"]) == ("Started", "Finished")
        tab.problems.clear()  # requests to a server that was away


DEVICES = {"phone": (360, 740, False), "tablet": (800, 1180, True), "desk": (1440, 900, False)}
ACTIVE = "button, a[href], select, input, summary"
SMALL = f"""[...document.querySelectorAll('{ACTIVE}')].filter((one) => one.checkVisibility())
  .map((one) => [one.textContent || one.id, one.getBoundingClientRect()])
  .filter(([, box]) => box.width < 43.9 || box.height < 43.9).map(([name]) => name)"""
STOP_SEEN = """(() => { const box = document.getElementById('stop').getBoundingClientRect();
  const seen = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  return Boolean(seen?.closest('#stop')) && box.bottom <= innerHeight && box.right <= innerWidth; })()"""
CONTROLS = {"button", "link", "combobox", "textbox", "tab", "checkbox", "spinbutton"}


@pytest.mark.parametrize("device", DEVICES)
def test_every_device_shows_all_with_stop_on_top(world: BrowserWorld, device: str) -> None:
    """Targets of 44 px, nothing wider than the screen, a name for each control, and no shade of STOP."""
    width, height, dark = DEVICES[device]
    with world.tab() as tab:
        tab.size(width, height, dark=dark)
        for view, ready in (("live", ".orders"), ("plan", ".options label"), ("back", ".mission")):
            tab.run(f"location.hash = '#{view}'")
            tab.until(f"document.querySelector('{ready}')")
            assert tab.run(SMALL) == [], view
            assert tab.run("document.documentElement.scrollWidth <= innerWidth"), view
            tab.run("scrollTo(0, 1e6)")
            assert tab.run(STOP_SEEN), view
            nodes = tab.call("Accessibility.getFullAXTree")["nodes"]
            controls = [one for one in nodes if one.get("role", {}).get("value") in CONTROLS]
            assert len(controls) > 8, view
            nameless = [one["role"]["value"] for one in controls if not one.get("name", {}).get("value")]
            assert nameless == [], view


def press_key(tab: Tab, key: str, code: int) -> None:
    for kind in ("rawKeyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)


def test_everything_is_reached_with_the_keyboard_alone(world: BrowserWorld) -> None:
    with world.tab() as tab:
        tab.until("document.querySelector('.orders')")
        reached = []
        for _ in range(60):
            press_key(tab, "Tab", 9)
            name = tab.run("document.activeElement.id || document.activeElement.textContent")
            if name in reached and name == reached[0]:
                break
            reached.append(name)
        assert {"stop", "tab-live", "tab-plan", "tab-back", "Start", "Push mission", "r1", "r2"} <= {*reached}
        assert reached[0] == "stop", "STOP comes first"
        tab.run("document.getElementById('tab-plan').focus()")
        tab.call("Input.dispatchKeyEvent", type="keyDown", key="Enter", text="\r", windowsVirtualKeyCode=13)
        tab.until("document.querySelector('#tab-plan').getAttribute('aria-selected') === 'true'")


def test_german_is_german_throughout(world: BrowserWorld) -> None:
    with world.tab() as tab:
        tab.press("Deutsch")
        tab.until("document.documentElement.lang === 'de' && document.querySelector('.orders')")
        try:
            words = "import('/pages/messages.js').then(({ MESSAGES }) => MESSAGES)"
            english, german = (tab.run(f"{words}.then((all) => all.{one})") for one in ("en", "de"))
            for view, ready in (("live", ".orders"), ("plan", ".options label"), ("back", ".mission")):
                tab.run(f"location.hash = '#{view}'")
                tab.until(f"document.querySelector('{ready}')")
                shown = tab.run(
                    "[...document.querySelectorAll('button, a, h2, dt, label, th, summary')]"
                    ".filter((one) => one.checkVisibility()).map((one) => one.innerText.trim())"
                )
                left = {one for one in shown if one in english.values() and one not in german.values()}
                assert left == set(), view
        finally:
            tab.run("localStorage.removeItem('stopgo-language')")


PRESSED = "document.querySelector('.map .stop').dispatchEvent(new KeyboardEvent('keydown', {key: '%s'}))"


def test_a_change_by_hand_shows_its_cost_before_it_is_planned(world: BrowserWorld) -> None:
    with world.tab("#plan") as tab:
        tab.shows("32 m², 2 rooms, 1 openings")
        tab.press("Plan", ".options button")
        tab.until("document.querySelector('.variant.focus.done') && document.querySelector('.map .stop')")
        variants = tab.run("document.querySelectorAll('.variant').length")
        tab.run(PRESSED % "Delete")
        tab.until("document.querySelector('.hand').innerText.includes('Coverage')")
        coverage, twice = tab.run("[...document.querySelector('.hand').innerText.matchAll(/\\((.*?) %\\)/g)]"
                                  ".map((one) => one[1])")  # fmt: skip
        assert (coverage[0], twice[0]) == ("−", "−")
        assert tab.run("document.querySelectorAll('.variant').length") == variants
        tab.press("Discard")
        tab.run(PRESSED % "ArrowUp")
        tab.until("document.querySelector('.hand').innerText.includes('Coverage')")
        assert tab.run("document.activeElement.dataset.stop") == "+1"
        nodes = tab.call("Accessibility.getFullAXTree")["nodes"]
        assert "Stop +1" in {one.get("name", {}).get("value") for one in nodes}
        tab.press("Plan with these changes")
        tab.until(f"document.querySelectorAll('.variant.done').length === {variants + 1}")
        tab.shows("Seen twice", ".variant")


def test_what_another_page_has_saved_meanwhile_is_not_pushed(world: BrowserWorld) -> None:
    """The page showed one mission, and pushed the one that another page had saved into its file since."""
    file = world.folder / "plans/house/mission.json"
    kept = file.read_bytes()
    with world.tab() as tab:
        tab.press("Push mission", card("r2", "button"))
        tab.until("document.querySelector('.question select')")
        tab.run("{ const list = document.querySelector('.question select'); list.value ="
                " 'plans/house/mission.json'; list.dispatchEvent(new Event('change')); }")  # fmt: skip
        tab.until(f"document.querySelector('{card('r2', '.difference')}').innerText")
        planned = read(file)
        write(with_digest(structs.replace(planned, revision=planned.revision + 1)), file)
        try:
            tab.press("Push to r2", card("r2", "button"))
            tab.shows("changed after the page showed the difference; look at it again", card("r2"))
        finally:
            file.write_bytes(kept)


LOST_ANSWER = """{ const real = window.fetch; window.fetch = (to, ...rest) => String(to).endsWith("/orders")
  ? real(to, ...rest).then(() => { throw new TypeError("Failed to fetch"); }) : real(to, ...rest); }"""
"""The server gets an order, and the page loses its link before the answer."""


def test_an_order_whose_answer_is_lost_is_not_called_unsent(world: BrowserWorld) -> None:
    """The robot had obeyed it, and the page said that it was not sent."""
    with world.tab() as tab:
        tab.shows("r2", card("r2"))
        tab.run(LOST_ANSWER)
        tab.press("Pause", card("r2", "button"))
        tab.shows("UNKNOWN whether it was carried out", card("r2", ".question"))
        assert "Not sent" not in tab.run("document.body.innerText")


FAILS_ONCE = """{ const real = window.fetch; let failed = false; window.fetch = (to, ...rest) =>
  String(to).endsWith("/drawing") && !failed
    ? Promise.reject(new TypeError(failed = "offline")) : real(to, ...rest);
  window.hasFailed = () => failed; }"""
"""The link of the page is lost for one drawing."""


def test_a_plan_whose_drawing_was_lost_once_is_drawn_the_next_time(world: BrowserWorld) -> None:
    """It was not drawn again, and its stops could not be changed, until the page was loaded anew."""
    with world.tab("#plan") as tab:
        tab.shows("32 m², 2 rooms, 1 openings")
        tab.run(FAILS_ONCE)
        tab.until("document.querySelector('.variant.done')")
        tab.run("document.querySelector('.variant.done button').click()")
        tab.until("window.hasFailed()")
        assert not tab.run("document.querySelector('.map .stop')")
        tab.run("document.querySelector('.variant.done button').click()")
        tab.until("document.querySelector('.map .stop')")


def test_a_name_for_a_plan_stays_while_another_page_plans(world: BrowserWorld) -> None:
    """Each message of the other plan made the field anew, with the name that it had at first."""
    field = "document.querySelector('.variant input')"
    with world.tab("#plan") as tab, world.tab("#plan") as other:
        tab.until(field)
        tab.run(f"{field}.focus()")
        tab.run(f"{field}.value = 'east wing'")
        before = tab.run("document.querySelectorAll('.variant').length")
        other.shows("32 m², 2 rooms, 1 openings")
        other.press("Plan", ".options button")
        tab.until(f"document.querySelectorAll('.variant.done').length > {before}")
        assert tab.run(f"{field}.value") == "east wing"
        assert tab.run(f"document.activeElement === {field}")


def pick(tab: Tab, field: str, value: str) -> None:
    """Choose a value in a field of the planning form."""
    tab.run(f"{{ const field = document.getElementById('{field}'); field.value = '{value}';"
            " field.dispatchEvent(new Event('change')); }")  # fmt: skip


def test_a_model_is_read_at_a_storey_and_a_day(world: BrowserWorld) -> None:
    """Both outlast a look at another page; another floor begins without them."""
    scheduled(house_model(), WORK).write(world.folder / "later.ifc")
    day = "document.getElementById('option-date')?.value"
    storey = "document.getElementById('option-storey')?.value"
    with world.tab("#plan") as tab:
        tab.until("document.querySelector('#floor option[value=\"later.ifc\"]')")
        pick(tab, "floor", "later.ifc")
        tab.shows("36 m², 2 rooms, 1 openings")
        pick(tab, "option-origin", "47.4,8.5,400,0")
        pick(tab, "option-date", "2024-03-20")
        tab.shows("on 2024-03-20: 7 built, 2 in progress, 1 not started", ".findings")
        pick(tab, "option-storey", '{"storey":"OG"}')
        tab.shows("36 m², 0 rooms, 0 openings")
        tab.run("location.hash = '#live'")
        tab.until("document.querySelector('.orders')")
        tab.run("location.hash = '#plan'")
        tab.shows("36 m², 0 rooms, 0 openings")
        assert (tab.run(storey), tab.run(day)) == ('{"storey":"OG"}', "2024-03-20")
        pick(tab, "floor", "house.dxf")
        tab.shows("32 m², 2 rooms, 1 openings")
        assert (tab.run(day), tab.run(day.replace("date", "origin"))) == ("", "")

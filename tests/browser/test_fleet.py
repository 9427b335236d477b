"""The Fleet view: what is filtered, counted and opened is what the tables say."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from app.engine.engine import Engine
from app.fleet.batch.work import run_drive
from app.fleet.desk import FleetDesk
from app.fleet.find import FleetTables
from app.fleet.pack import pack
from app.fleet.store import Store
from pipeline.params import Params
from pipeline.sources import open_source
from tests.app.fleet.fleets import begun, make_fleet, plan_of
from tests.browser.conftest import WAIT_MS, CountedDetector, OpenPage, Pages, Site, opening
from tests.browser.judges import LOW_CONTRAST
from tests.browser.looks import box_of
from tests.browser.test_look import SCREENS


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of three short drives, with LiDAR alone."""
    folder = tmp_path_factory.mktemp("fleet")
    work = begun(plan_of(make_fleet(folder / "in"), sensors="lidar"), folder / "out")
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(folder / "out")), work.key.name)
    return folder / "out"


@pytest.fixture(scope="module")
def tables(out: Path) -> FleetTables:
    return FleetTables(Store(str(out)))


@pytest.fixture(scope="module")
def fleet_site(out: Path) -> Iterator[Site]:
    """A dashboard with a fleet, which shows one of its drives. Of its own: after other drives, that of all other files
    would compute its own anew."""
    shown = str(out.parent / "in" / "near-0.mcap")
    engine = Engine(open_source, CountedDetector, Params(), uri=shown, whole_drives=True)
    engine.start()
    engine.wait_for(lambda s: s.processed is not None, WAIT_MS / 1e3)
    running = Site(engine, 0, fleet=FleetDesk(str(out)))
    running.start()
    yield running
    running.stop()
    engine.stop()


@pytest.fixture
def open_fleet(pages: Pages, fleet_site: Site) -> Iterator[OpenPage]:
    with opening(pages, fleet_site) as begin:

        def opened(**how: object) -> Page:
            page = begin(**how)
            page.get_by_role("button", name="Fleet", exact=True).click()
            settled(page)
            return page

        yield opened


def settled(page: Page) -> None:
    expect(page.locator("#fleet-dialog")).to_have_attribute("aria-busy", "false")


def found(page: Page) -> int:
    """Number of rows stated by the view."""
    settled(page)
    return int(page.inner_text("#fleet-facts").split()[0])


def test_filters_find_what_the_tables_hold(open_fleet: OpenPage, tables: FleetTables):
    page = open_fleet()
    assert found(page) == tables.find("").total > 0
    page.get_by_role("group", name="Kinds of event").get_by_role("button", name="first acquisition").click()
    expect(page.locator("#fleet-facts")).to_contain_text(f"{tables.find('first_acquisition').total} events")
    distances = [row[4] for row in tables.find("first_acquisition", columns=("distance_m",)).rows]
    middle = f"{sum(distances) / len(distances):.2f}"
    page.get_by_label("Distance of the CIPV to").fill(middle)
    page.keyboard.press("Enter")
    near = tables.find(f"first_acquisition and distance_m <= {middle}").total
    assert 0 < near < tables.find("first_acquisition").total
    expect(page.locator("#fleet-facts")).to_contain_text(f"{near} events")
    assert found(page) == page.locator("#fleet-rows tbody tr").count()
    page.get_by_label("Condition").fill("false -- nothing")
    page.keyboard.press("Enter")
    expect(page.locator("#fleet-facts")).to_contain_text("0 events")
    expect(page.locator("#fleet-rows tbody")).to_have_text("Nothing meets these filters.")
    settled(page)
    page.get_by_role("button", name="Clear filters").click()
    expect(page.locator("#fleet-facts")).to_contain_text(f"{tables.find('').total} events")
    settled(page)


def test_what_is_typed_while_charts_load_is_kept(open_fleet: OpenPage, tables: FleetTables):
    page = open_fleet()
    held: list[Route] = []
    is_slow = True

    def answer(route: Route) -> None:
        if is_slow:
            held.append(route)
        else:
            route.continue_()

    page.route("**/api/fleet/histogram?*", answer)
    with page.expect_request("**/api/fleet/histogram?*"):
        page.get_by_role("group", name="Kinds of event").get_by_role("button", name="first acquisition").click()
    low, high = (page.get_by_label(f"Distance of the CIPV {word}") for word in ("from", "to"))
    low.fill("5")
    high.fill("60")
    page.get_by_label("Ego speed from").press_sequentially("1")
    is_slow = False
    for each in held:
        each.continue_()
    both = tables.find("first_acquisition and distance_m >= 5 and distance_m <= 60").total
    assert 0 < both <= tables.find("first_acquisition").total
    expect(page.locator("#fleet-facts")).to_contain_text(f"{both} events")
    settled(page)
    expect(low).to_have_value("5")
    expect(high).to_have_value("60")
    expect(page.get_by_label("Ego speed from")).to_have_value("1")
    expect(page.get_by_label("Ego speed from")).to_be_focused()
    page.get_by_role("button", name="Clear filters").click()
    expect(low).to_have_value("")
    expect(high).to_have_value("")
    settled(page)


def test_a_histogram_is_dragged_over_to_choose_a_range(open_fleet: OpenPage, tables: FleetTables):
    page = open_fleet()
    page.get_by_role("tab", name="frames").click()
    expect(page.locator("#fleet-facts")).to_contain_text("24 frames")
    settled(page)
    bars = page.get_by_role("region", name="Distance of the CIPV").locator(".fleet-bars")
    edges, counts = tables.histogram("", "frames", "distance_m")
    assert [float(each) for each in bars.locator("i").evaluate_all("all => all.map(b => b.title.split(': ')[1])")] == [
        *counts
    ]
    box = box_of(bars)
    page.mouse.move(box["x"] + 1, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.45, box["y"] + 20)
    page.mouse.up()
    high = float(f"{edges[int(0.45 * len(counts)) + 1]:.4g}")
    low = float(f"{edges[0]:.4g}")
    chosen = tables.find(f"distance_m between {low} and {high}", "frames").total
    expect(page.locator("#fleet-facts")).to_contain_text(f"{chosen} frames")
    assert 0 < chosen < sum(counts)
    settled(page)


def test_rows_are_sorted_by_a_column(open_fleet: OpenPage):
    page = open_fleet()
    page.get_by_role("tab", name="frames").click()
    for way in ("ascending", "descending"):
        page.get_by_role("button", name="distance (m)").click()
        expect(page.locator("#fleet-rows th[aria-sort]")).to_have_attribute("aria-sort", way)
        settled(page)
        place = page.locator("#fleet-rows th").evaluate_all("all => all.findIndex(each => each.ariaSort)")
        shown = page.locator(f"#fleet-rows tbody td:nth-child({place + 1})").all_inner_texts()
        numbers = [float(each) for each in shown if each != "–"]
        assert len(set(numbers)) > 3
        assert numbers == sorted(numbers, reverse=way == "descending")
        assert shown[: len(numbers)] == [each for each in shown if each != "–"], "unknown values are last"


def test_a_press_opens_the_moment(open_fleet: OpenPage, fleet_site: Site, tables: FleetTables):
    page = open_fleet()
    page.get_by_role("tab", name="frames").click()
    expect(page.locator("#fleet-facts")).to_contain_text("24 frames")
    settled(page)
    row = tables.find('"index" = 5', "frames")
    address = dict(zip(row.columns, row.rows[1], strict=True))["address"]
    page.get_by_label("Condition").fill('"index" = 5')
    page.keyboard.press("Enter")
    expect(page.locator("#fleet-facts")).to_contain_text("3 frames")
    settled(page)
    page.locator("#fleet-rows tbody tr").nth(1).click()
    expect(page.locator("#fleet-dialog")).to_be_hidden()
    fleet_site.engine.wait_for(lambda s: s.uri == address and s.index == 5 and not s.playing, WAIT_MS / 1e3)
    expect(page.locator("#transport .where .dim")).to_have_text("6/8")


def test_back_leads_to_the_rows_and_forward_to_the_moment(open_fleet: OpenPage, fleet_site: Site, tables: FleetTables):
    page = open_fleet()
    page.get_by_role("tab", name="frames").click()
    page.get_by_label("Condition").fill('"index" = 5')
    page.keyboard.press("Enter")
    expect(page.locator("#fleet-facts")).to_contain_text("3 frames")
    settled(page)
    row = tables.find('"index" = 5', "frames")
    first, second = (dict(zip(row.columns, each, strict=True))["address"] for each in row.rows[:2])
    page.locator("#fleet-rows tbody tr").nth(0).click()
    fleet_site.engine.wait_for(lambda s: s.uri == first and s.index == 5, WAIT_MS / 1e3)
    page.go_back()
    expect(page.locator("#fleet-facts")).to_contain_text("3 frames")
    settled(page)
    page.locator("#fleet-rows tbody tr").nth(1).click()
    fleet_site.engine.wait_for(lambda s: s.uri == second and s.index == 5, WAIT_MS / 1e3)
    page.get_by_role("button", name="Fleet", exact=True).click()
    settled(page)
    page.get_by_role("button", name="Close", exact=True).click()
    fleet_site.engine.control.change(uri=first, playing=False, target=0)
    fleet_site.engine.wait_for(lambda s: s.uri == first, WAIT_MS / 1e3)
    page.go_back()
    expect(page.locator("#fleet-dialog")).to_be_visible()
    settled(page)
    page.go_forward()
    expect(page.locator("#fleet-dialog")).to_be_hidden()
    fleet_site.engine.wait_for(lambda s: s.uri == second and s.index == 5, WAIT_MS / 1e3)


def test_long_names_leave_room_for_the_figures(open_fleet: OpenPage):
    page = open_fleet()

    def lengthened(route: Route) -> None:
        found = route.fetch()
        said = found.json()
        place = said["columns"].index("title")
        said["rows"][0][place] = "Without_a_space_" * 30
        route.fulfill(response=found, json=said)

    page.route("**/api/fleet/rows*", lengthened)
    page.get_by_role("tab", name="drives").click()
    expect(page.locator("#fleet-rows")).to_contain_text("Without_a_space_")
    settled(page)
    assert page.locator(".fleet-rows").evaluate("box => box.scrollWidth <= box.clientWidth")


def test_the_page_says_that_it_is_searching(open_fleet: OpenPage):
    page, asked = open_fleet(), list[Route]()
    page.route("**/api/fleet/rows*", lambda route: asked.append(route))  # playwright wants no bound method
    page.get_by_role("tab", name="drives").click()
    expect(page.locator("#fleet-facts")).to_have_text("Searching…")
    asked.pop().continue_()
    expect(page.locator("#fleet-facts")).to_contain_text("3 drives")
    settled(page)


def test_a_wrong_condition_is_said_in_words(open_fleet: OpenPage):
    page = open_fleet(expects=("409",))
    page.get_by_label("Condition").fill("no_such_column > 1")
    page.keyboard.press("Enter")
    expect(page.get_by_role("alert").filter(has_text="no_such_column")).to_be_visible()
    settled(page)
    expect(page.locator("#fleet-facts")).to_have_text("")


def test_what_was_found_before_does_not_stay_below_a_wrong_condition(open_fleet: OpenPage):
    page, rows = open_fleet(expects=("409",)), "#fleet-rows tbody tr"
    bars, chips = page.locator("#fleet-charts .fleet-bars i"), page.get_by_role("group", name="Kinds of event")
    acquired = chips.get_by_role("button", name="first acquisition")
    acquired.click()
    before = found(page)
    expect(acquired).to_have_text(f"first acquisition {before}")
    expect(page.locator(rows)).to_have_count(before)
    assert bars.count() > 0
    page.get_by_label("Condition").fill("no_such_column > 1")
    page.keyboard.press("Enter")
    expect(page.get_by_role("alert").filter(has_text="no_such_column")).to_be_visible()
    settled(page)
    assert (page.locator(rows).count(), bars.count()) == (0, 0)
    expect(acquired).to_have_text("first acquisition")  # to be taken back; how many there are is unknown
    expect(acquired).to_have_attribute("aria-pressed", "true")
    page.get_by_label("Condition").fill("")
    page.keyboard.press("Enter")
    expect(page.locator(rows)).to_have_count(before)
    settled(page)
    assert bars.count() > 0


def test_without_a_fleet_the_page_says_how_to_open_one(open_page: OpenPage):
    page = open_page()
    page.get_by_role("button", name="Fleet", exact=True).click()
    expect(page.locator("#fleet-dialog")).to_contain_text("cipv serve SOURCE --fleet DIR")


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_words_stand_out_from_their_ground(open_fleet: OpenPage, theme: str):
    page = open_fleet(color_scheme=theme)
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / f"fleet_{theme}.png")
    assert page.evaluate(LOW_CONTRAST) == []
    cut = "all => all.filter(head => head.scrollWidth > head.clientWidth).map(head => head.textContent)"
    assert page.locator("#fleet-rows th").count() > 5
    assert page.locator("#fleet-rows th").evaluate_all(cut) == []

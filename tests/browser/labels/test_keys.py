"""Keys can be changed on a page of them, and are kept per person."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import START
from tests.browser.judges import LOW_CONTRAST
from tests.browser.labels.hands import Hand, Labels, draw, is_saved

pytestmark = pytest.mark.usefixtures("paused_in_traffic")
SCREENS = Path(__file__).resolve().parents[3] / "build" / "screens"


def test_a_key_is_changed_refused_where_it_is_taken_and_kept_for_its_person(hand: Hand, labels: Labels):
    page = hand.page
    made = draw(hand, labels)
    is_saved(page)
    page.keyboard.press("?")
    dialog = page.locator("#help-dialog")
    dialog.get_by_role("button", name="Change keys").click()
    flip = dialog.locator("[title^='Change the key: reverse the track']")
    flip.click()
    expect(flip).to_have_text("press a key")
    page.keyboard.press("a")
    expect(dialog.get_by_role("status")).to_contain_text("A is already used: in review: approve")
    flip.click()
    page.keyboard.press("Shift+B")
    expect(dialog.get_by_role("status")).to_contain_text("Shift B is already used")
    flip.click()
    page.keyboard.press("Control+b")
    expect(flip).to_have_text("Ctrl B")
    SCREENS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENS / "keys.png")
    assert page.evaluate(LOW_CONTRAST) == []
    twice = page.evaluate(
        """async () => {
          const { labelKeys } = await import("/js/labeling/keys.js");
          const on = labelKeys().flatMap(({ bindings }) => bindings).filter(({ isOn }) => isOn());
          const names = on.flatMap(({ keys }) => keys);
          return names.filter((name, place) => names.indexOf(name) !== place);
        }"""
    )
    assert twice == [], "no key that is on does two things"
    dialog.get_by_role("button", name="Close").click()
    expect(page.locator("#label-keys")).to_contain_text("Ctrl B reverse")

    yaw = labels.cuboid(made, START)["yaw_rad"]
    page.keyboard.press("Shift+X")
    page.keyboard.press("Control+b")
    labels.wait_for(lambda now: abs(abs(now.cuboid(made, START)["yaw_rad"] - yaw) - 3.1416) < 0.01)
    assert len([each for each in labels.get(f"/history?kind=track&id={made}") if "reversed" in each["what"]]) == 1, (
        "the old key does nothing"
    )
    other = page.evaluate(
        """async () => {
          const { set } = await import("/js/core/store.js");
          set("person", "Grace");
          return document.querySelector("#label-keys").textContent;
        }"""
    )
    assert "Shift X reverse" in other, "another person has other keys"
    page.evaluate("async () => (await import('/js/core/store.js')).set('person', null)")
    page.keyboard.press("?")
    dialog.get_by_role("button", name="Change keys").click()
    dialog.get_by_role("button", name="Reset all").click()
    expect(dialog.locator("[title^='Change the key: reverse the track']")).to_have_text("Shift X")
    dialog.get_by_role("button", name="Close").click()


def test_while_labeling_no_key_moves_the_camera_of_the_3d_view(hand: Hand, labels: Labels):
    page = hand.page
    page.route("**/viser/**", lambda route: route.fulfill(body="<input>", content_type="text/html"))
    made = draw(hand, labels)
    before = labels.cuboid(made, START)["yaw_rad"]
    page.get_by_role("tab", name="3D").click()
    view = page.frame_locator("iframe[title='3D view']")
    heard = "body => { body.ownerDocument.addEventListener('keydown', ({ code }) => (body.dataset.heard = code)); }"
    view.locator("body").evaluate(heard)  # as viser listens
    view.locator("body").click()
    hand.keys("e")
    labels.wait_for(lambda now: now.cuboid(made, START)["yaw_rad"] < before)
    expect(view.locator("body")).not_to_have_attribute("data-heard", "KeyE")
    view.locator("input").click()
    page.keyboard.press("e")
    expect(view.locator("input")).to_have_value("e")
    view.locator("body").click(position={"x": 5, "y": 60})
    hand.keys("Shift+L")
    expect(page.locator("#label-bar")).to_be_hidden()
    hand.keys("s")
    expect(view.locator("body")).to_have_attribute("data-heard", "KeyS")
    hand.keys("Shift+L")
    expect(page.locator("#label-bar")).to_be_visible()
    page.keyboard.press("Escape")
    page.get_by_role("tab", name="Plan").click()
    page.unroute("**/viser/**")

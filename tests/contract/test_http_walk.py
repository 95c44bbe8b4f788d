"""Walk of a user through the pages in a real browser, from three files to a report.

Every page on the way is checked in light and dark and at 1280 and 390 pixels: no message on the
console, no request to another host, no serious accessibility finding of axe-core, no sideways
scrolling, no text below 11 pixels, no buttons that overlap.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.io

from tests.app.browser import needs_browser, wait_until_settled
from tests.app.service import serving
from tests.app.waiting import WAITS
from tests.ingest.writers import workbook
from tests.motors import campaign, motor_named

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page, Request, Route
from tests.app.walk import Walk

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser

CHANGES = re.compile("/pending/(labels|run_[a-z0-9]+/mapping)$")
"""Addresses to which the page sends changes of new files."""
RPM = 60.0 / (2.0 * 3.141592653589793)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three runs of the 100 W servo: German CSV, workbook with units, MATLAB struct of channels."""
    pytest.importorskip("openpyxl", reason="openpyxl is not installed")
    pytest.importorskip("python_calamine", reason="python-calamine is not installed")
    directory = tmp_path_factory.mktemp("files")
    names = ("pruefstand.csv", "bench.xlsx", f"scope{4 * '_of_the_second_bench'}.mat")
    paths = [directory / name for name in names]
    runs = campaign(motor_named("servo 100 W"), seed=3, runs=3, rows=600)
    german, sheet, scope = runs
    rows = zip(german.time * 1e3, german.voltage, german.current, german.speed * RPM, strict=True)
    lines = ["Zeit [ms];U [V];I [A];n [rpm]", *(";".join(map(repr, map(float, r))) for r in rows)]
    paths[0].write_text("\n".join(lines).replace(".", ",") + "\n", encoding="utf-8")
    columns = [sheet.time, sheet.voltage, sheet.current, sheet.speed]
    head = ["t [s]", "voltage [V]", "current [A]", "speed [rad/s]"]
    table: list[list[object]] = [[*head], *np.column_stack(columns).tolist()]
    workbook(paths[1], {"Run": table})
    channels = {"CH1": scope.voltage, "CH2": scope.current, "CH3": scope.speed}
    scipy.io.savemat(paths[2], {"time_s": scope.time, **channels})
    return paths


@pytest.fixture(scope="module")
def walk(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    """Browser on the start page of an empty service."""
    directory = tmp_path_factory.mktemp("walk")
    pipeline = {"PIPELINE": "tests.app.waiting:identify"}
    with (
        serving(directory / "data", "--no-auth", **pipeline) as server,
        chromium.new_context(timezone_id="Asia/Kolkata") as context,
    ):
        context.set_default_timeout(60_000)
        yield Walk(context.new_page(), server)


def test_user_walks_from_three_files_to_a_report(walk: Walk, files: list[Path]) -> None:
    """Each step waits for what the page shows; the steps are those of the words on the page."""
    page = walk.page
    page.goto(walk.server.url)
    walk.check()
    add_three_files(walk, files)
    walk.check()

    read_a_refusal(walk)
    start_fit(page)
    # The page says "succeeded" before it loads itself again with the result.
    page.wait_for_selector("text=Open report")
    walk.check()
    address = page.url
    page.click("text=Open report")
    page.frame_locator("iframe").locator(".uplot").first.wait_for()
    walk.check()
    page.click(".back a >> nth=0")
    assert page.url == address

    compare_two_fits(walk)
    look_at_the_pages_of_a_fit(walk, address)
    cancel_a_fit(walk)
    page.goto(f"{walk.server.url}/nowhere")
    # The browser itself reports the status of the page on the console.
    assert all("404" in message for message in walk.console)
    walk.console.clear()
    walk.check()
    page.click("main >> text=Runs and fits")
    page.locator("tr[data-fit]").first.wait_for()
    assert page.locator("tr[data-fit]").count() == 3
    walk.check()


def add_three_files(walk: Walk, files: list[Path]) -> None:
    """Drop three files, reload in between, correct one mapping by selection, add the runs."""
    page = walk.page
    page.fill("#motor", "servo")
    page.fill("#bench", "bench 4")
    walk.drop(files)
    page.locator("article.pending").nth(2).wait_for()
    assert page.locator(".state.ready").count() == 2
    page.reload()
    assert page.input_value("#motor") == "servo"
    page.locator("article.pending .uplot").first.wait_for()
    walk.check()
    scope = page.locator("article.pending", has_text="scope_of")
    select_when_replaced(scope, "Unit of voltage", "V")
    for channel, column, unit in (
        ("voltage", "CH1", "V"), ("current", "CH2", "A"), ("speed", "CH3", "rad/s"),
    ):  # fmt: skip
        for label, text in ((f"Column of {channel}", column), (f"Unit of {channel}", unit)):
            menu = scope.get_by_label(label)
            if label != "Unit of voltage":
                menu.select_option(text)
            # The page has come back with the selection.
            chosen = menu.locator("option[selected]", has_text=re.compile(f"^{text}$"))
            chosen.wait_for(state="attached")
    scope.locator(".state.ready").wait_for()
    # One route for both steps: Playwright can lose a request between the end of one and another.
    page.route(CHANGES, send_late)
    overtake(page.locator("article.pending", has_text="bench.xlsx"), "Sign of current")
    # What was typed just before the click reaches the service first, however slowly.
    page.fill("#motor", "servo 1")
    page.click("text=Add 3 runs")
    page.locator("#runs tr").nth(2).wait_for()
    page.unroute(CHANGES)
    motors = [field.input_value() for field in page.locator("#runs input").all()]
    assert motors == 3 * ["servo 1"]
    page.wait_for_selector("table.prospects")
    assert page.locator("#chosen").inner_text().startswith("Proposed: 2 training and 1 validation")
    shown = page.locator("#runs time").first
    uploaded = str(shown.get_attribute("title"))
    # Kolkata is 5 h 30 min ahead of UTC.
    assert shown.inner_text()[-2:] == f"{(int(uploaded[14:16]) + 30) % 60:02d}"


def send_late(route: Route) -> None:
    """Send a request a second after the page."""
    time.sleep(1.0)
    route.continue_()


def select_when_replaced(article: Locator, label: str, text: str) -> None:
    """Select an option in the task that next replaces an article, faster than any user."""
    article.evaluate(
        """(article, [label, text]) => {
          const section = article.parentElement;
          new MutationObserver((_, observer) => {
            observer.disconnect();
            const shown = document.getElementById(article.id);
            const menu = shown.querySelector(`[aria-label="${label}"]`);
            menu.value = text;
            menu.dispatchEvent(new Event("change", {bubbles: true}));
          }).observe(section, {childList: true});
        }""",
        [label, text],
    )


def overtake(article: Locator, label: str) -> None:
    """Change a menu and change it back before the answer; the service gets one after the other."""
    page = article.page
    address = f"/pending/{article.get_attribute('id')}/mapping"
    order: list[tuple[str, str]] = []

    def note(step: str, request: Request) -> bool:
        if request.url.endswith(address):
            order.append((step, (request.post_data_json or {})["current_A.sign"]))
        return order[-1:] == [("answered", "+")]

    def note_sent(request: Request) -> None:
        note("sent", request)

    page.on("request", note_sent)
    with page.expect_response(lambda answer: note("answered", answer.request)):
        article.get_by_label(label).evaluate(
            """async menu => {
              for (const sign of ["-", "+"]) {
                const sent = new Promise(resolve => {
                  menu.form.addEventListener("htmx:beforeRequest", resolve, {once: true});
                });
                menu.value = sign;
                menu.dispatchEvent(new Event("change", {bubbles: true}));
                if (sign === "-") await sent;
              }
            }"""
        )
    page.remove_listener("request", note_sent)
    assert order == [("sent", "-"), ("answered", "-"), ("sent", "+"), ("answered", "+")]


def read_a_refusal(walk: Walk) -> None:
    """A refused fit says why, for as long as nothing else succeeds, and erases nothing."""
    page = walk.page
    with page.expect_response("**/prospects"):
        # The answer that the page itself requests arrives after the refusal and leaves it.
        page.reload()
        page.click("text=More options")
        page.fill("[name=known]", "Kt25=foo")
        page.click("text=Start fit")
        page.locator("#problem", has_text="expected NAME=VALUE").wait_for()
    wait_until_settled(page)
    assert page.locator("#problem .notice").is_visible()
    assert page.input_value("[name=known]") == "Kt25=foo"
    # The browser itself and htmx report the status on the console.
    assert all(re.search("422|responseError", message) for message in walk.console)
    walk.console.clear()
    page.fill("[name=known]", "")


def start_fit(page: Page) -> None:
    """Choose roles in one step and start a short fit."""
    with page.expect_response(re.compile("/choice")):
        page.click("text=All training")
    page.fill("#choice-pattern", "scope")
    with page.expect_response(re.compile("/choice")):
        page.click("text=Apply")
    page.reload()
    assert page.locator("#runs option:checked", has_text="validation").count() == 1
    page.uncheck("[name=posterior]")
    page.uncheck("[name=effects]")
    page.click("text=Start fit")
    page.wait_for_url("**/fits/fit_*")


def compare_two_fits(walk: Walk) -> None:
    """Fit the same runs again with another seed, and compare both on the page of the motor."""
    page = walk.page
    page.goto(walk.server.url)
    page.click("text=More options")
    page.fill("[name=seed]", "1")
    page.uncheck("[name=posterior]")
    page.uncheck("[name=effects]")
    page.click("text=Start fit")
    page.wait_for_url("**/fits/fit_*")
    page.wait_for_selector("text=Open report")
    page.click("h1 >> text=servo 1")
    walk.check()
    assert page.locator("input[name=fit]:checked").count() == 2
    newest = page.locator("tbody time").first.inner_text()
    days = {moment[:10] for moment in page.locator("tbody time").all_inner_texts()}
    axis = page.locator("svg text[data-time]").last.text_content()
    assert axis == (newest[11:] if len(days) == 1 else newest[:10])
    page.click("text=Compare the two selected fits")
    page.locator("text=Simulation error").first.wait_for()
    assert page.locator("#parameters-title").is_visible()
    assert page.locator("th >> text=Ra25").count() == 1
    assert page.locator("text=The fits share 2 training runs").count() == 1
    walk.check()


def look_at_the_pages_of_a_fit(walk: Walk, address: str) -> None:
    """The loop, the prediction and the keys have no finding either."""
    page = walk.page
    page.goto(address)
    page.click("text=Try another controller")
    page.locator("figure svg").first.wait_for()
    walk.check()
    page.goto(address)
    page.click("text=Measured and simulated runs")
    page.locator("#predicted-title").wait_for()
    walk.check()
    page.goto(f"{walk.server.url}/keys")
    walk.check()


def cancel_a_fit(walk: Walk) -> None:
    """Start a long fit, watch it, reload, and cancel it."""
    page = walk.page
    page.goto(walk.server.url)
    # The options of the last fit of this motor are still there, and in sight.
    assert page.input_value("[name=seed]") == "1"
    page.fill("[name=seed]", str(WAITS))
    page.click("text=Start fit")
    page.wait_for_url("**/fits/fit_*")
    page.wait_for_selector(".state.running")
    page.locator(".stage", has_text=re.compile(r" · [1-9]\d* %")).wait_for()
    page.reload()
    assert page.locator("progress").is_visible()
    walk.check()
    lose_and_regain_the_service(walk)
    stale = page.context.new_page()
    stale.route("**/api/v1/fits/*", fail_reading)
    stale.goto(page.url)
    with page.expect_navigation():
        page.click("text=Cancel")
    page.wait_for_selector(".state.cancelled")
    # A second cancellation would remove the fit.
    with stale.expect_navigation():
        stale.click("text=Cancel")
    stale.wait_for_selector(".state.cancelled")
    stale.close()


def fail_reading(route: Route) -> None:
    """Abort a request that reads, so that the page stays as it is."""
    if route.request.method == "GET":
        route.abort()
    else:
        route.fallback()


def lose_and_regain_the_service(walk: Walk) -> None:
    """The start page says that the service does not respond, and goes on when it does."""
    page, address = walk.page, walk.page.url
    page.goto(walk.server.url)
    page.context.set_offline(True)
    problem = page.locator("#problem", has_text="does not respond")
    problem.wait_for()
    page.context.set_offline(False)
    problem.wait_for(state="detached")
    page.goto(address)
    # The browser itself reports the lost connection on the console.
    assert all("net::" in message for message in walk.console)
    walk.console.clear()

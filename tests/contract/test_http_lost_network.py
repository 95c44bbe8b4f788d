"""Start page on a network that is gone for a while, with or without an error."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.app.browser import Held, needs_browser, opened, wait_until_settled
from tests.app.pretended import FAMILY
from tests.app.service import Caller, Server, empty, run_text

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Route

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser

LONG_MS = 10_500
"""Time after which a page asks whether the service is there."""
CALL_MS = 20_500
"""Time after which a call without an answer is given up."""


@pytest.fixture
def server(open_server: Server) -> Server:
    """Service without keys."""
    return open_server


@pytest.fixture
def caller(server: Server) -> Iterator[Caller]:
    """Script, with three runs of two motors and nothing else in the service."""
    empty(server)
    with Caller(server) as made:
        for seed, motor in enumerate(("other", "servo", "servo")):
            made.upload(run_text(seed), name=f"run{seed}.csv", motor=motor)
        yield made


@pytest.fixture
def page(chromium: Browser, server: Server, caller: Caller) -> Iterator[Page]:
    """Start page with the two runs of the servo, whose clock the test can advance."""
    with opened(chromium, f"{server.url}/healthz") as shown:
        shown.clock.install()
        shown.goto(server.url)
        wait_until_settled(shown)
        yield shown


def lose(page: Page, pattern: str = "**/healthz") -> None:
    """Let requests end with an error; without a pattern the page finds no service."""
    page.route(pattern, lambda route: route.abort())


def type_motor(page: Page, motor: str) -> None:
    """Type another motor of a run, and go to the next field."""
    page.get_by_label("Motor of run1.csv").fill(motor)
    page.keyboard.press("Tab")


def motors(caller: Caller) -> dict[str, str | None]:
    """Motor of each run in the service."""
    return {run.content["file"]: run.content["motor"] for run in caller.client.runs()}


def unsaved(page: Page, words: str) -> None:
    """Wait until the page says what is not saved."""
    page.locator("#unsaved", has_text=f"Not saved: {words}. ").wait_for()


def test_change_without_an_answer_holds_back_no_other(page: Page, caller: Caller) -> None:
    """The page gives up the first change, sends the second, and repeats the first on request."""
    lose(page)
    with Held(page, "**/runs/*/motor*") as requests:
        type_motor(page, "drive")
        requests.wait()
        with page.expect_response(re.compile("/choice")):
            page.get_by_label("Role of run2.csv").select_option("validation")
            page.clock.fast_forward(LONG_MS)
        unsaved(page, "Motor of run1.csv")
        typed = page.get_by_label("Motor of run1.csv").input_value()
        requests.held.clear()
    before = motors(caller)
    page.click("text=Send again")
    wait_until_settled(page)

    assert (typed, before["run1.csv"]) == ("drive", "servo")
    assert motors(caller)["run1.csv"] == "drive"
    assert page.inner_text("#unsaved") + page.inner_text("#problem") == ""


def test_slow_answer_is_waited_for(page: Page, caller: Caller) -> None:
    """The service responds to other requests, so that the page does not give up."""
    with Held(page, "**/runs/*/motor*") as requests:
        type_motor(page, "drive")
        requests.wait()
        for _ in range(5):
            with page.expect_response("**/healthz"):
                page.clock.fast_forward(LONG_MS)
        requests.release()
    wait_until_settled(page)

    assert motors(caller)["run1.csv"] == "drive"
    assert page.inner_text("#unsaved") + page.inner_text("#problem") == ""


def test_progress_of_an_upload_is_no_loss(page: Page) -> None:
    """Bytes are sent every 8 s while no other request gets through; then nothing is sent."""
    lose(page)
    page.evaluate(
        """async () => {
          const { guard } = await import("/static/calls.js");
          window.upload = new EventTarget();
          upload.upload = new EventTarget();
          upload.abort = () => (upload.isAborted = true);
          guard(upload);
        }"""
    )
    for _ in range(4):
        page.clock.fast_forward(8_000)
        page.evaluate("upload.upload.dispatchEvent(new Event('progress'))")
    page.wait_for_timeout(300)
    during = page.evaluate("upload.isAborted")
    with page.expect_event("requestfailed"):
        page.clock.fast_forward(LONG_MS)
    page.wait_for_timeout(300)

    assert (during, page.evaluate("upload.isAborted")) == (None, True)


def test_file_without_an_answer_holds_back_no_other(page: Page, tmp_path: Path) -> None:
    """The page names the file that was not sent; the next one may take any time."""
    paths = [tmp_path / f"new{seed}.csv" for seed in (10, 11)]
    for seed, path in enumerate(paths, 10):
        path.write_bytes(run_text(seed))
    lose(page)
    with Held(page, "**/pending") as files:
        page.set_input_files("#files", paths)
        files.wait()
        page.clock.fast_forward(LONG_MS)
        files.wait(2)
        page.unroute("**/healthz")
        files.held.pop(0)
        files.release()
    page.locator("#pending-confirm[data-new='1']").wait_for()

    assert page.locator("#received .bad").inner_text().startswith("new10.csv could not be sent")
    assert page.locator("article h3").inner_text().startswith("new11.csv")


def test_fit_has_the_motor_that_was_not_saved_at_first(page: Page, caller: Caller) -> None:
    """The page sends it again before the fit."""
    page.select_option("#choice-motor", "other")
    page.get_by_label("Role of run0.csv").select_option("training")
    lose(page, "**/runs/*/motor*")
    page.get_by_label("Motor of run0.csv").fill("drive")
    page.keyboard.press("Tab")
    unsaved(page, "Motor of run0.csv")
    page.unroute("**/runs/*/motor*")
    page.click("text=Start fit")
    page.wait_for_url("**/fits/fit_*")

    assert [fit.content["motor"] for fit in caller.client.fits()] == ["drive"]


def test_text_that_was_not_saved_remains_in_a_new_table(page: Page) -> None:
    """A later change succeeds and replaces the table."""
    lose(page, "**/runs/*/motor*")
    type_motor(page, "drive")
    unsaved(page, "Motor of run1.csv")
    page.click("text=None")
    page.locator("#chosen", has_text=re.compile("^0 training")).wait_for()
    wait_until_settled(page)

    assert page.get_by_label("Motor of run1.csv").input_value() == "drive"
    unsaved(page, "Motor of run1.csv")


def test_run_has_the_correction_that_was_not_saved_at_first(
    page: Page, caller: Caller, tmp_path: Path
) -> None:
    """The page sends it again before it adds the run."""
    path = tmp_path / "new20.csv"
    path.write_bytes(run_text(20))
    page.set_input_files("#files", path)
    page.locator("#pending-confirm[data-new='1']").wait_for()
    lose(page, "**/pending/*/mapping")
    page.get_by_label("Sign of current").select_option("-")
    unsaved(page, "Mapping of new20.csv")
    page.unroute("**/pending/*/mapping")
    page.click("text=Add 1 run")
    page.locator("#runs", has_text="new20.csv").wait_for()
    [run] = [run for run in caller.client.runs() if run.content["file"] == "new20.csv"]

    assert run.content["mapping"]["current_A"]["scale"] == -1.0


def test_fit_that_is_requested_again_after_a_lost_answer_is_the_same(
    page: Page, caller: Caller
) -> None:
    """The service has received the first request; the page tells nobody so."""

    def lose_answer(route: Route) -> None:
        if route.request.method == "POST":
            route.fetch()
        route.abort()

    page.route("**/fits", lose_answer)
    page.click("text=Start fit")
    page.locator("#problem", has_text="No answer to “Start fit”").wait_for()
    page.unroute("**/fits")
    page.click("#start button")
    page.wait_for_url("**/fits/fit_*")

    assert len(list(caller.client.fits())) == 1


def test_table_is_that_of_the_selected_motor_after_an_error(page: Page) -> None:
    """The runs of another motor cannot be shown."""
    lose(page, "**/choice?motor=other")
    page.select_option("#choice-motor", "other")
    page.locator("#problem", has_text="does not respond").wait_for()
    wait_until_settled(page)

    assert page.input_value("#choice-motor") == "servo"


def test_prospects_are_computed_again_on_request(page: Page) -> None:
    """After a failure, the page no longer says that they are computed."""
    page.wait_for_selector("#prospects h3")
    lose(page, "**/prospects")
    page.reload()
    page.locator("#prospects", has_text="could not be computed").wait_for()
    page.unroute("**/prospects")
    page.click("text=Compute again")
    page.wait_for_selector("#prospects h3")

    assert page.inner_text("#problem") == ""


def test_progress_goes_on_after_a_call_without_an_answer(
    page: Page, server: Server, caller: Caller
) -> None:
    """The page says that the service does not respond, until a call is answered."""
    fit = caller.begin(next(iter(caller.client.runs())).id, seed=FAMILY)["id"]
    with Held(page, "**/api/v1/fits?*", "GET") as calls:
        page.reload()
        calls.wait()
        page.clock.fast_forward(CALL_MS)
        page.locator("#problem", has_text="does not respond").wait_for()
        calls.held.clear()
    with Held(page, f"{server.url}/", "GET") as lists:
        caller.http.delete(f"/fits/{fit}")
        lists.wait()
        # The list that shows the end of the fit may take its time.
        during = page.inner_text("#problem")
    page.locator("#work .state.cancelled").wait_for()

    assert (during, page.inner_text("#problem")) == ("", "")


def test_new_file_is_counted_once_the_service_responds(page: Page, tmp_path: Path) -> None:
    """The button that adds it is not disabled for ever."""

    def lose_count(route: Route) -> None:
        route.abort() if route.request.method == "GET" else route.fallback()

    path = tmp_path / "new30.csv"
    path.write_bytes(run_text(30))
    page.route("**/pending", lose_count)
    with page.expect_event("requestfailed"):
        page.set_input_files("#files", path)
    page.unroute("**/pending")
    wait_until_settled(page)
    page.clock.fast_forward(3_500)

    page.locator("#pending-confirm[data-new='1']:enabled").wait_for()


def test_fit_that_was_removed_without_an_answer_can_be_removed_again(
    page: Page, server: Server, caller: Caller
) -> None:
    """The fit is gone, and the list cannot be shown without it."""
    caller.wait(caller.begin(next(iter(caller.client.runs())).id)["id"])
    page.reload()
    lose(page, f"{server.url}/")
    page.click("#work >> text=Remove")
    page.locator("#problem", has_text="does not respond").wait_for()
    page.unroute(f"{server.url}/")
    page.click("#work >> text=Remove")
    page.locator("#work >> text=No fits yet").wait_for()

    assert list(caller.client.fits()) == []

"""Pages of a loop, a tuning and the next run in a browser: computation, end, lost connections."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from tests.app.analysed import Bench
from tests.app.browser import Held, needs_browser, opened, wait_until_settled
from tests.app.service import Server

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser


@pytest.fixture
def fit(bench: Bench) -> tuple[Server, str]:
    """Service with a fit of one run of the 100 W servo."""
    return bench.server, bench.first


@pytest.fixture
def page(chromium: Browser, fit: tuple[Server, str]) -> Iterator[Page]:
    """Page of the next run."""
    server, fit_id = fit
    with opened(chromium, f"{server.url}/fits/{fit_id}/design") as shown:
        yield shown


@pytest.fixture
def loop(page: Page) -> Page:
    """Page of the speed loop."""
    page.goto(page.url.replace("/design", "/loop"))
    return page


def ended_requests(server: Server, fit_id: str, kind: str) -> list[dict[str, Any]]:
    """Entries of the log for computations of a page."""
    return [e for e in requests_of(server, f"/fits/{fit_id}/{kind}") if e["status"] != 200]


def requests_of(server: Server, path: str) -> list[dict[str, Any]]:
    """Entries of the log for ended requests of a path."""
    entries = [json.loads(line) for line in list(server.log) if line.startswith("{")]
    return [e for e in entries if e["message"] == "request" and e["path"] == path]


def test_design_is_shown_in_its_place_and_asked_for_once(page: Page) -> None:
    """While it is computed the page says so, and neither key nor click sends it again."""
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url))
    page.fill("#narrow", "J")
    page.press("#narrow", "Enter")
    page.wait_for_selector("text=The run is designed")
    is_disabled = page.is_disabled("form.loop button")
    page.press("#narrow", "Enter")
    page.wait_for_selector("#gain-title")

    assert is_disabled
    assert sum("/design?" in url for url in sent) == 1
    assert "narrow=J" in page.url
    assert page.is_hidden(".busy")
    assert page.is_enabled("form.loop button")
    assert page.evaluate("document.activeElement.id") == "gain-title"


def test_refused_design_leaves_the_form(page: Page) -> None:
    """The sentence stands in the place of the design, and the field keeps its text."""
    page.fill("#limits", "current=x")
    with page.expect_response(re.compile("/design[?]")) as answer:
        page.click("form.loop button")
    page.wait_for_selector("#answer >> text=positive number in A")

    assert answer.value.status == 422
    assert "limits=current" in page.url
    assert page.inner_text("#problem") == ""
    assert page.input_value("#limits") == "current=x"
    assert page.is_hidden(".busy")


@pytest.mark.parametrize(("kind", "label"), [("design", "Design"), ("tuning", "Compute")])
def test_cancelled_computation_is_ended_by_the_service(
    page: Page, fit: tuple[Server, str], kind: str, label: str
) -> None:
    """Status 400 in the log: the process was killed when the browser closed the request."""
    server, fit_id = fit
    page.goto(f"{server.url}/fits/{fit_id}/{kind}")
    before = len(ended_requests(server, fit_id, kind))
    page.click("form.loop button")
    page.click("text=Cancel")
    page.wait_for_selector(".busy", state="hidden")
    deadline = time.monotonic() + 60.0
    while len(ended := ended_requests(server, fit_id, kind)[before:]) < 1:
        assert time.monotonic() < deadline
        time.sleep(0.1)

    assert [entry["status"] for entry in ended] == [400]
    assert page.inner_text("#problem") == ""
    assert page.evaluate("document.activeElement.textContent") == label


def test_tuning_that_nobody_waits_for_is_ended(fit: tuple[Server, str]) -> None:
    """The same by HTTP: the client gives up before the answer."""
    server, fit_id = fit
    path = f"/api/v1/fits/{fit_id}/tunings"
    body = {"specification": {"settling_time": 0.05, "overshoot": 1}, "kinds": ["PID", "PI+FF"]}
    with pytest.raises(httpx.ReadTimeout):
        httpx.post(server.url + path, json=body, timeout=0.5)
    deadline = time.monotonic() + 60.0
    while not (ended := requests_of(server, path)):
        assert time.monotonic() < deadline
        time.sleep(0.1)

    assert [entry["status"] for entry in ended] == [400]


def test_tuning_is_shown_in_its_place(page: Page, fit: tuple[Server, str]) -> None:
    """The address has the fields; a refused specification stands in the same place."""
    server, fit_id = fit
    page.goto(f"{server.url}/fits/{fit_id}/tuning")
    page.click("form.loop button")
    page.wait_for_selector("text=The controller is computed")
    page.wait_for_selector("#answer >> text=draws meet the specification")
    focused = page.evaluate("document.activeElement.id")
    page.fill("#delay", "x")
    page.click("form.loop button")
    page.wait_for_selector("#answer >> text=is not a number")

    assert focused == "answer-title"
    assert "delay=x" in page.url
    assert page.is_hidden(".busy")
    assert page.inner_text("#problem") == ""


def test_lost_connection_is_said_and_the_form_remains(page: Page) -> None:
    """The next design, once there is a connection, removes the sentence."""
    page.fill("#limits", "current=-1")
    page.context.set_offline(True)
    page.click("form.loop button")
    page.wait_for_selector("#problem >> text=does not respond")
    shown = page.is_visible(".busy")
    page.context.set_offline(False)
    page.click("form.loop button")
    page.wait_for_selector("#answer >> text=positive number in A")

    assert not shown
    assert page.inner_text("#problem") == ""


def test_step_response_is_marked_until_it_is_that_of_the_fields(loop: Page) -> None:
    """The first answer comes when another gain was typed, and an error leaves the mark."""
    stale = loop.locator("#loop-result.stale")
    with Held(loop, "**/loop?*", "GET", is_answered=True) as answers:
        loop.fill("#kp", "2")
        answers.wait()
        is_marked = stale.count()
        loop.fill("#kp", "3")
        answers.wait(2)
    wait_until_settled(loop)
    heading = loop.inner_text("#response-title")
    is_marked_after = stale.count()
    loop.route("**/loop?*", lambda route: route.abort())
    loop.locator("#kp").press_sequentially("0")
    loop.locator("#problem", has_text="does not respond").wait_for()

    assert (is_marked, is_marked_after) == (1, 0)
    assert heading == "Step response with P:3"
    assert stale.count() == 1
    assert loop.evaluate("document.activeElement.id") == "kp"
    loop.unroute("**/loop?*")
    loop.click("text=Compute")
    stale.wait_for(state="detached")
    assert loop.inner_text("#problem") == ""


def test_text_typed_during_a_computation_keeps_the_focus(page: Page) -> None:
    """The answer is marked, because it does not belong to the new text."""
    with Held(page, "**/design?*", "GET", is_answered=True) as answers:
        page.fill("#limits", "current=x")
        page.press("#limits", "Enter")
        answers.wait()
        page.focus("#rate")
        page.keyboard.type("10")
    page.wait_for_selector("#answer >> text=positive number in A")
    page.keyboard.type("00")

    assert page.input_value("#rate") == "1000"
    assert page.locator("#answer.stale").count() == 1


def test_table_of_five_temperatures_needs_no_scrolling(page: Page, fit: tuple[Server, str]) -> None:
    """At 1280 pixels."""
    server, fit_id = fit
    query = "overshoot=10&controller=PI:0.2,20&temperature=-40,25,80,100,125"
    page.goto(f"{server.url}/fits/{fit_id}/tuning?{query}")
    widths = page.locator("#answer .scroll").evaluate("one => [one.scrollWidth, one.clientWidth]")

    assert widths[0] == widths[1]


def test_field_shows_what_was_computed_after_back(page: Page, bench: Bench) -> None:
    """The browser restores no selection to which the answer does not belong."""
    page.goto(f"{bench.server.url}/fits/{bench.first}/prediction?run={bench.runs[0]}")
    page.select_option("#model", "nominal model")
    page.click("nav >> text=Compare")
    page.go_back()

    assert page.input_value("#model") == "false"

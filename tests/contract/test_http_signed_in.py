"""Pages in a browser that signed in with a key: lost sessions, keys, and several pages of a fit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

import httpx
import pytest

from app.identifiers import new_id
from tests.app.browser import Held, needs_browser, wait_until_settled
from tests.app.pretended import FAMILY
from tests.app.service import Caller, Server, make_key, run_text, serving

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Route

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser

STREAMS = 1
OPTIONS = {
    "known": "Kt25=0.05",
    "nameplate": "voltage=12, no_load_speed=3000rpm",
    "effort": "quick",
    "seed": "7",
}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Service with keys, each of which may have one event stream."""
    data_dir = tmp_path_factory.mktemp("signed") / "data"
    make_key(data_dir)
    with serving(data_dir, STREAMS_PER_KEY=STREAMS, WORKERS=3) as running:
        yield running


@pytest.fixture
def key(server: Server) -> str:
    """Key that no other test uses."""
    return make_key(server.data_dir, "bench")


@pytest.fixture
def caller(server: Server, key: str) -> Iterator[Caller]:
    """Script with this key."""
    with Caller(server, key) as made:
        yield made


@pytest.fixture
def page(chromium: Browser, server: Server, key: str) -> Iterator[Page]:
    """Start page in a browser that signed in with this key."""
    with chromium.new_context(base_url=server.url) as context:
        opened = context.new_page()
        opened.set_default_timeout(60_000)
        opened.goto("/")
        sign_in(opened, key)
        yield opened


def sign_in(page: Page, key: str) -> None:
    """Type the key on the login page."""
    page.fill("#key", key)
    page.click("main >> text=Sign in >> nth=-1")
    page.wait_for_selector("#upload-title")


def options(page: Page) -> dict[str, str]:
    """Values of the fields of `OPTIONS`."""
    return {name: page.input_value(f"#start [name={name}]") for name in OPTIONS}


def wait_until_restored(page: Page) -> None:
    """Wait until the page has put back the options that it had kept."""
    page.locator("#start[data-is-restored]").wait_for()


def test_options_of_a_fit_outlive_the_session(page: Page, caller: Caller, key: str) -> None:
    """They are there after the next sign-in, and the key is in no storage of the browser."""
    caller.upload(run_text(1))
    page.reload()
    defaults = options(page)
    page.click("text=More options")
    for name, value in OPTIONS.items():
        field = page.locator(f"#start [name={name}]")
        field.select_option(value) if name == "effort" else field.fill(value)
    page.uncheck("[name=posterior]")
    page.context.clear_cookies()
    page.click("text=Start fit")
    page.wait_for_url("**/login?ended")
    sign_in(page, key)
    wait_until_restored(page)

    assert options(page) == OPTIONS
    assert not page.is_checked("[name=posterior]")
    assert page.locator("[name=known]").is_visible()
    assert "motorid_" not in page.evaluate("JSON.stringify([sessionStorage, localStorage])")
    with page.expect_navigation():
        page.click("text=Start fit")
    page.goto("/")
    wait_until_restored(page)
    assert options(page) == OPTIONS, "the motor is fitted again after a refused fit"
    caller.upload(run_text(6), motor="another")
    page.goto("/")
    assert options(page) == defaults


def test_sign_in_leads_back_to_the_page_of_a_fit(page: Page, caller: Caller, key: str) -> None:
    """The session ended while the fit was watched."""
    fit = caller.begin(caller.upload(run_text(7))["id"], seed=FAMILY)["id"]
    page.goto(f"/fits/{fit}")
    page.context.clear_cookies()
    page.reload()
    page.wait_for_url(re.compile("/login.*next="))
    page.fill("#key", key)
    page.click("main >> text=Sign in >> nth=-1")
    page.wait_for_url(f"**/fits/{fit}")
    caller.http.delete(f"/fits/{fit}")
    page.wait_for_selector(".state.cancelled")


def test_options_of_a_fit_end_with_the_sign_out(page: Page, caller: Caller, key: str) -> None:
    """The next user of this tab gets the defaults, and so does another workspace."""
    caller.upload(run_text(2))
    page.reload()
    defaults = options(page)
    page.click("text=More options")
    page.fill("[name=known]", OPTIONS["known"])
    page.evaluate(
        "sessionStorage.setItem('fit-options', JSON.stringify({"
        "workspace: 'other', chosen: [['known', 'L=1']]}))"
    )
    page.reload()
    other = options(page)
    page.click("text=More options")
    page.fill("[name=known]", OPTIONS["known"])
    page.click("text=Sign out")
    page.wait_for_selector("#key")
    sign_in(page, key)

    assert (other, options(page)) == (defaults, defaults)


def test_second_press_while_a_key_is_created_creates_none(page: Page) -> None:
    """The secret of the first key is shown, and no other key exists."""
    page.goto("/keys")
    page.fill("#name", "bench 9")
    with Held(page, "**/keys", is_answered=True) as answers:
        page.hover("text=Create key")
        for _ in range(2):
            page.mouse.down()
            page.mouse.up()
            answers.wait()
            page.wait_for_timeout(300)
    page.locator(".secret").wait_for()

    assert page.locator("tbody th", has_text="bench 9").count() == 1


def test_key_whose_secret_was_lost_is_named_and_revoked(page: Page) -> None:
    """The service creates the key, and the answer does not arrive; nor does one to a second press.

    The page asks once the service responds again, also after it was loaded anew.
    """
    page.on("dialog", lambda dialog: dialog.accept())
    page.goto("/keys")

    def lose(route: Route) -> None:
        if route.request.method == "POST":
            route.fetch()
        route.abort()

    page.route(re.compile(r"/keys(\?|$)"), lose)
    page.fill("#name", "bench 7")
    page.click("text=Create key")
    page.wait_for_selector("#problem >> text=does not respond")
    page.unroute(re.compile(r"/keys(\?|$)"))
    page.reload()
    page.locator("[role=alert]", has_text="The key bench 7 was created").wait_for()
    shown = page.locator(".secret").count(), page.locator("tbody th", has_text="bench 7").count()
    page.get_by_label("Revoke the unseen key bench 7").click()
    page.locator("#keys [role=alert]").wait_for(state="detached")

    assert shown == (0, 1)
    assert page.locator("tr", has_text="bench 7").locator(".state").inner_text() == "revoked"
    page.reload()
    wait_until_settled(page)
    assert page.locator("#keys [role=alert]").count() == 0


def test_key_that_was_not_created_is_sent_again(page: Page) -> None:
    """The request does not arrive; the form keeps its text, and its second press makes one key."""
    page.goto("/keys")
    page.route("**/keys", lambda route: route.abort(), times=1)
    page.fill("#name", "bench 6")
    page.click("text=Create key")
    page.wait_for_selector("#keys-problem >> text=was not created")
    assert page.inner_text("#problem") == ""
    page.click("text=Create key")
    page.locator(".secret").wait_for()

    assert page.locator("tbody th", has_text="bench 6").count() == 1


def test_form_of_a_key_that_is_sent_again_creates_no_second_key(server: Server, key: str) -> None:
    """The answer names the key; an ID of another form is refused."""
    headers = {"Authorization": f"Bearer {key}", "HX-Request": "true"}
    form = {"name": "bench 5", "key": new_id("key")}
    first, second, other = (
        httpx.post(f"{server.url}/keys", data=each, headers=headers)
        for each in (form, form, form | {"key": "bench"})
    )

    assert ('class="secret"' in first.text, 'class="secret"' in second.text) == (True, False)
    assert "The key bench 5 was created, but" in second.text
    assert other.status_code == 422


def test_new_key_remains_while_others_are_managed(page: Page) -> None:
    """A refused form keeps its text, and the secret is shown until the page is left."""
    page.goto("/keys")
    page.fill("#name", "bench 8")
    page.fill("#days", "soon")
    page.check("[name=owner]")
    page.click("text=Create key")
    page.wait_for_selector("#keys-problem >> text=is not a number")
    fields = page.input_value("#name"), page.input_value("#days"), page.is_checked("[name=owner]")
    page.fill("#days", "3")
    page.press("#days", "Enter")
    page.locator(".secret").wait_for()
    focused = page.evaluate("document.activeElement.innerText")
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("tbody button >> nth=0")
    page.locator("tr", has_text="bench 8").locator(".state", has_text="revoked").wait_for()

    assert fields == ("bench 8", "soon", True)
    assert page.inner_text(".secret") in focused
    assert page.evaluate("document.activeElement.id") == "keys-table"
    assert page.inner_text("#problem") == ""


def test_hidden_page_of_a_fit_asks_nothing(page: Page, caller: Caller) -> None:
    """It shows the state again once it can be seen."""
    fit = caller.begin(caller.upload(run_text(4))["id"], seed=FAMILY)["id"]
    page.goto(f"/fits/{fit}")
    page.wait_for_selector(".state.running")
    set_hidden = """isHidden => {
      Object.defineProperty(document, "hidden", {value: isHidden, configurable: true});
      document.dispatchEvent(new Event("visibilitychange"));
    }"""
    page.evaluate(set_hidden, True)
    page.wait_for_timeout(2000)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.wait_for_timeout(3000)
    while_hidden = list(asked)
    caller.http.delete(f"/fits/{fit}")
    page.evaluate(set_hidden, False)
    page.wait_for_selector(".state.cancelled")

    assert while_hidden == []


def test_listener_that_has_heard_the_end_needs_no_stream(caller: Caller) -> None:
    """A browser that reconnects at the limit of streams is stopped by 204 and not refused."""
    run = caller.upload(run_text(5))["id"]
    ended, endless = caller.begin(run, posterior=False)["id"], caller.begin(run, seed=FAMILY)["id"]
    caller.wait(ended)
    heard = caller.http.get(f"/fits/{ended}/events").text
    version = re.findall(r"^id: (\d+)$", heard, re.MULTILINE)[-1]
    with caller.http.stream("GET", f"/fits/{endless}/events"):
        refused = caller.http.get(f"/fits/{ended}/events")
        stopped = caller.http.get(f"/fits/{ended}/events", headers={"Last-Event-ID": version})
    caller.client.delete_fit(endless)

    assert refused.status_code == 429
    assert int(refused.headers["retry-after"]) > 0
    assert stopped.status_code == 204

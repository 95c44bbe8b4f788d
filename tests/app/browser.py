"""Headless Chromium: rendered page, console messages and network requests.

`show` starts the browser for each page with a new profile.  Its network log contains every request
of the page, with or without a response.  `launched` and `opened` are for tests that use a page.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import APIResponse, Browser, Page, Route

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
"""Mark that skips a test if no browser is installed."""

_SWITCHES = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-default-apps", "--disable-extensions", "--disable-dev-shm-usage",
    "--disable-features=OptimizationHints,MediaRouter",
    # Block the requests of the browser itself: the pages use IP addresses, not host names.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--enable-logging=stderr", "--window-size=1200,900",
)  # fmt: skip
_NETWORK = re.compile(r"https?|wss?|ftp")


@dataclass(frozen=True)
class Shown:
    """Page as rendered by the browser.

    Args:
        dom: The document as text, after its scripts have run.
        console: Console messages of the page or of its policy.
        requests: URLs that the page requested.
    """

    dom: str
    console: list[str]
    requests: list[str]


def show(address: str, directory: Path, *, wait_ms: int = 4000) -> Shown:
    """Render a page.

    Args:
        address: URL of the page.
        directory: Directory for the profile and the network log.
        wait_ms: Virtual time in which the scripts of the page can run [ms].
    """
    record = directory / "network.json"
    finished = subprocess.run(
        [
            *(str(BROWSER), *_SWITCHES, f"--virtual-time-budget={wait_ms}"),
            *(f"--user-data-dir={directory / 'profile'}", f"--log-net-log={record}"),
            *("--dump-dom", address),
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    console = [line for line in finished.stderr.splitlines() if re.search(r"CONSOLE|Refused", line)]
    return Shown(finished.stdout, console, _requests(record))


@contextmanager
def launched() -> Iterator[Browser]:
    """Start a browser, in which the tests of a module open pages."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # Without a graphics process, a page takes a quarter less processor time.
        arguments = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--in-process-gpu"]
        browser = playwright.chromium.launch(executable_path=BROWSER, args=arguments)
        yield browser
        browser.close()


@contextmanager
def opened(browser: Browser, address: str) -> Iterator[Page]:
    """Open a page with a profile of its own, which accepts every question."""
    with browser.new_context() as context:
        context.set_default_timeout(60_000)
        page = context.new_page()
        page.on("dialog", lambda dialog: dialog.accept())
        page.goto(address)
        yield page


@contextmanager
def browsing(address: str) -> Iterator[Page]:
    """Open a page in a browser of its own."""
    with launched() as browser, opened(browser, address) as page:
        yield page


@dataclass
class Held:
    """Requests of a page that are held until they are released, in their order.

    Args:
        page: The page.
        pattern: Addresses of the requests.
        method: Method of the requests.
        is_answered: Whether the service receives the requests and the answers are held.
    """

    page: Page
    pattern: str
    method: str = "POST"
    is_answered: bool = False
    held: list[tuple[Route, APIResponse | None]] = field(default_factory=list)

    def __enter__(self) -> Held:
        """Hold further requests."""
        self.page.route(self.pattern, self._hold)
        return self

    def __exit__(self, *error: object) -> None:
        """Release what is still held, and hold nothing more."""
        self.method = ""
        self.release()
        self.page.unroute(self.pattern)

    def _hold(self, route: Route) -> None:
        if route.request.method != self.method:
            route.fallback()
            return
        self.held.append((route, route.fetch() if self.is_answered else None))

    def wait(self, count: int = 1) -> None:
        """Wait until so many requests are held."""
        until = time.monotonic() + 60.0
        while len(self.held) < count:
            assert time.monotonic() < until, f"{len(self.held)} of {count} requests"
            self.page.wait_for_timeout(20)

    def release(self) -> None:
        """Release the held requests, and those that they cause, in their order."""
        while self.held:
            route, answer = self.held.pop(0)
            if answer is None:
                route.continue_()
            else:
                route.fulfill(response=answer)
            self.page.wait_for_timeout(300)


def wait_until_settled(page: Page) -> None:
    """Wait until the answers of all requests of htmx are on a page, and no change waits.

    The state "networkidle" of Playwright never comes while a page watches a fit.
    """
    busy = page.locator("[data-busy], .htmx-request, .htmx-swapping, .htmx-settling")
    busy.first.wait_for(state="detached")


def _requests(record: Path) -> list[str]:
    """URLs in a network log, except those requested by the browser itself."""
    text = record.read_text(encoding="utf-8")
    try:
        events = json.loads(text)["events"]
    except ValueError:
        # A browser that is killed leaves the JSON list unclosed.
        events = json.loads(text.rstrip().rstrip(",") + "]}")["events"]
    asked = [event["params"] for event in events if "method" in event.get("params", {})]
    addresses = [
        words["url"]
        for words in asked
        # A request of the browser itself has no initiator and is no frame.
        if words.get("initiator") != "not an origin" or words.get("request_type") != "other"
    ]
    return [address for address in dict.fromkeys(addresses) if _NETWORK.match(address)]

"""A real browser, without a window, and what it asked for and complained of while it showed a page.

The browser is Debian's Chromium, started anew for each page with a profile of its own.  Its own
record of the network tells every request that the page made, whether it was answered or not.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
"""Skips a test where there is no browser."""

_SWITCHES = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-default-apps", "--disable-extensions", "--disable-dev-shm-usage",
    "--disable-features=OptimizationHints,MediaRouter",
    # The browser asks its maker for news; no name is looked up, and the page asks by number.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--enable-logging=stderr", "--window-size=1200,900",
)  # fmt: skip
_NETWORK = re.compile(r"https?|wss?|ftp")


@dataclass(frozen=True)
class Shown:
    """A page as the browser showed it.

    Args:
        dom: The document after its scripts had run, as text.
        console: Lines that the page or its policy wrote to the console.
        requests: Addresses that the page asked the network for.
    """

    dom: str
    console: list[str]
    requests: list[str]


def show(address: str, directory: Path, *, wait_ms: int = 4000) -> Shown:
    """Show a page.

    Args:
        address: Of the page.
        directory: Where the profile and the record of the network go.
        wait_ms: Time of the page's own clock to let its scripts run [ms].
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


def _requests(record: Path) -> list[str]:
    """Addresses of the requests in a record of the network, without those of the browser itself."""
    text = record.read_text(encoding="utf-8")
    try:
        events = json.loads(text)["events"]
    except ValueError:
        # A browser that is ended leaves the list open.
        events = json.loads(text.rstrip().rstrip(",") + "]}")["events"]
    asked = [event["params"] for event in events if "method" in event.get("params", {})]
    addresses = [
        words["url"]
        for words in asked
        # What the browser asks on its own account was begun by no page and is no frame.
        if words.get("initiator") != "not an origin" or words.get("request_type") != "other"
    ]
    return [address for address in dict.fromkeys(addresses) if _NETWORK.match(address)]

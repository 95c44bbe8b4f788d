"""Open pages behind which the service ends and starts again on the same port and data."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.app.browser import needs_browser, opened, wait_until_settled
from tests.app.pretended import FAMILY
from tests.app.service import Caller, Server, run_text

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser


def free_port() -> str:
    """Port that no program uses."""
    with socket.socket() as opened_socket:
        opened_socket.bind(("127.0.0.1", 0))
        return str(opened_socket.getsockname()[1])


def test_pages_continue_behind_a_restart(chromium: Browser, data_dir: Path) -> None:
    """Once by SIGKILL and once by SIGTERM; the fit runs on, and a motor that was typed is kept."""
    arguments = ("--no-auth", "--port", free_port())
    server = Server(data_dir, *arguments)
    try:
        with Caller(server) as caller:
            fit = caller.begin(caller.upload(run_text(1), motor="servo")["id"], seed=FAMILY)["id"]
            caller.wait(fit, "running")
        with (
            opened(chromium, f"{server.url}/fits/{fit}") as page,
            opened(chromium, server.url) as start,
        ):
            page.locator(".state.running").wait_for()
            for restarts, end in enumerate((Server.kill, Server.stop), start=1):
                end(server)
                page.locator("#problem", has_text="page continues when it does").wait_for()
                start.get_by_label("Motor of run.csv").fill(f"drive {restarts}")
                start.keyboard.press("Tab")
                start.locator("#unsaved", has_text="Not saved: Motor of run.csv.").wait_for()
                server = Server(data_dir, *arguments)
                page.locator("#problem:empty").wait_for(state="attached")
                start.click("text=Send again")
                start.locator("#unsaved:empty").wait_for(state="attached")
                wait_until_settled(start)
                with Caller(server) as caller:
                    attempt = caller.wait(fit, "running")["attempt"]
                    motors = [run.content["motor"] for run in caller.client.runs()]
                assert (attempt, motors) == (1 + restarts, [f"drive {restarts}"])
                assert page.locator(".state.running").count() == 1
    finally:
        if server.process.poll() is None:
            server.kill()

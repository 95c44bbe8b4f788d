"""Faults of the service itself: a problem or a page with a request ID that the log has."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from app.http.headers import PAGE_POLICY
from tests.app.service import API, Server

SECRET = "a bug of the service"


class Broken(Server):
    """Server whose lists of fits raise an exception that no handler expects."""

    command = (
        "from app.fits.service import FitService\n"
        f"def page(*given, **more): raise RuntimeError('{SECRET}')\n"
        "FitService.page = page\n" + Server.command
    )


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Running broken server without keys."""
    server = Broken(tmp_path_factory.mktemp("unexpected") / "data", "--no-auth")
    yield server
    server.stop()


def logged(server: Server, request: str) -> list[dict[str, Any]]:
    """Entries of the log for a request, up to the one with its status."""
    deadline = time.monotonic() + 30.0
    while time.monotonic() < deadline:
        entries = [json.loads(line) for line in list(server.log) if line.startswith("{")]
        found = [entry for entry in entries if entry.get("request_id") == request]
        if any("status" in entry for entry in found):
            return found
        time.sleep(0.05)
    raise AssertionError(f"the log has no status of {request}")


def test_call_gets_a_problem_whose_request_id_is_in_the_log(broken: Server) -> None:
    """Status 500 and the code; the exception is in the log alone, and only once."""
    answer = httpx.get(f"{broken.url}{API}/fits")

    problem = answer.json()
    assert answer.status_code == problem["status"] == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert problem["code"] == "internal"
    assert problem["request_id"] == answer.headers["x-request-id"]
    assert SECRET not in answer.text
    entries = logged(broken, problem["request_id"])
    assert [SECRET in entry.get("exception", "") for entry in entries] == [True, False]
    assert entries[1]["status"] == 500


@pytest.mark.parametrize("headers", [{"Accept": "text/html"}, {"HX-Request": "true"}])
def test_browser_gets_a_page_with_the_request_id(broken: Server, headers: dict[str, str]) -> None:
    """A page, or a sentence inside of one, with the headers of every other page."""
    answer = httpx.get(f"{broken.url}/compare", headers=headers)

    assert answer.status_code == 500
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"] == PAGE_POLICY
    assert f"<code>{answer.headers['x-request-id']}</code>" in answer.text
    assert "Internal error of the service" in answer.text
    assert SECRET not in answer.text
    assert logged(broken, answer.headers["x-request-id"])

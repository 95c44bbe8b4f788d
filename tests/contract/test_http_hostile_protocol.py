"""Broken HTTP, methods and queries: a 4xx or a closed connection, and the server lives."""

from __future__ import annotations

import json

import httpx
import pytest

from tests.app.service import Caller, Server
from tests.contract.hostile import assert_is_problem, raw


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("PUT", "/runs"),
        ("PATCH", "/fits"),
        ("DELETE", "/fits"),
        ("POST", "/healthz"),
        ("X", "/runs"),
    ],
)
def test_method_that_an_address_does_not_take_is_refused(
    alice: Caller, method: str, path: str
) -> None:
    """405, and the answer says which methods it takes."""
    answer = alice.http.request(method, path)

    assert_is_problem(answer, 405)
    assert answer.headers["allow"]


@pytest.mark.parametrize(
    "query",
    [
        "limit=0",
        "limit=1001",
        "limit=-1",
        "limit=many",
        "limit=" + "9" * 5000,
        "after=x",
        "after=%00",
        "after=bm9uZQ",
        "after=" + "A" * 200,
        "after=aW5mIHg",
        "motor=" + "m" * 201,
    ],
    ids=lambda query: query[:20],
)
def test_query_that_is_not_accepted_is_refused(alice: Caller, query: str) -> None:
    """422 for a page of no length and for positions that were never given."""
    assert_is_problem(alice.http.get(f"/runs?{query}"), 422)


RAW = {
    "no http": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc",
    "two lengths": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
    b"Content-Length: 6\r\n\r\nhello",
    "length and chunks": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "negative length": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\n"
    b"Content-Length: -1\r\n\r\n",
    "bad chunk": b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\n"
    b"Transfer-Encoding: chunked\r\n\r\nzz\r\n\r\n",
    "endless header": b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: " + b"y" * 200_000,
    "no host": b"GET /healthz HTTP/1.1\r\n\r\n",
    "two hosts": b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n",
    "NUL in the path": b"GET /api/v1/runs\x00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "web socket": b"GET /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
    b"Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    b"Sec-WebSocket-Version: 13\r\n\r\n",
}


@pytest.mark.parametrize("request_bytes", RAW.values(), ids=RAW.keys())
def test_broken_http_is_refused_and_the_server_lives(server: Server, request_bytes: bytes) -> None:
    """A 4xx or a closed connection, and health answers afterwards."""
    answer = raw(server, request_bytes)

    assert answer == b"" or answer.startswith(b"HTTP/1.1 4"), answer[:200]
    assert httpx.get(f"{server.url}/healthz").status_code == 200


def test_hostile_requests_left_no_trace_of_an_error_of_the_service(server: Server) -> None:
    """Whatever ran before this in the session: no answer was a 500."""
    lines = [json.loads(line) for line in list(server.log) if line.startswith("{")]

    assert [line for line in lines if line.get("status", 0) >= 500] == []
    for line in lines:
        # uvicorn refuses a broken chunk itself, and then logs that our answer comes too late.
        assert "LocalProtocolError" in line.get("exception", "LocalProtocolError")

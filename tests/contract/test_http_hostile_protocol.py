"""Malformed HTTP, methods and queries: 4xx or a closed connection; the server survives."""

from __future__ import annotations

import json
import time

import httpx
import pytest

from tests.app.service import API, Caller, Server
from tests.contract.hostile import JSON, assert_is_problem, raw


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
def test_unsupported_method_is_refused(alice: Caller, method: str, path: str) -> None:
    """The response is 405 with an Allow header."""
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
        "motor=%00",
        "motor=a%01b",
        "motor=a%0Ab",
        "motor=%C2%85",
        "motor=%E2%80%AE",
        "%00=1",
        "nothing=" + "a" * 1001,
    ],
    ids=lambda query: query[:20],
)
def test_invalid_query_is_refused(alice: Caller, query: str) -> None:
    """Invalid limits, cursors and filters give 422.

    PostgreSQL cannot compare with NUL, so such a filter would cause an internal error.
    """
    assert_is_problem(alice.http.get(f"/runs?{query}"), 422)
    assert_is_problem(alice.http.get(f"/fits?{query}"), 422)


@pytest.mark.parametrize("text", ["\0", "\ud800", "a\x01", "\u202e", "m" * 1001], ids=ascii)
def test_unprintable_text_in_a_body_is_refused(alice: Caller, stored: str, text: str) -> None:
    """Values and field names give 422, and the response does not repeat the text."""
    bodies: dict[str, list[dict[str, object]]] = {
        "/fits": [
            {"training": [text]},
            {"training": [stored], "motor": text},
            {"training": [stored], "options": {"controllers": [text]}},
            {"training": [stored], "options": {text: 1}},
        ],
        "/batches": [{"motors": [{"training": [stored]}], "name": text}, {"motors": [], text: 1}],
    }
    for path, contents in bodies.items():
        for content in contents:
            sent = json.dumps(content)
            answer = alice.http.post(path, content=sent, headers=JSON)
            assert_is_problem(answer, 422)
            assert "expected at most 1000 printable characters" in answer.json()["detail"]
            assert json.dumps(text)[1:-1] not in answer.text


@pytest.mark.parametrize(
    "path", ["/runs", "/runs/{run}", "/fits", "/batches", "/healthz", "/metrics", "/openapi.json"]
)
def test_head_answers_as_get_without_a_body(alice: Caller, stored: str, path: str) -> None:
    """RFC 9110: HEAD has the status and headers of GET."""
    address = path.format(run=stored)
    head, get = alice.http.head(address), alice.http.get(address)

    assert head.status_code == get.status_code == 200
    assert head.content == b""
    assert head.headers["content-type"] == get.headers["content-type"]
    if path != "/metrics":
        assert head.headers["content-length"] == get.headers["content-length"]


def test_head_of_events_ends_at_once(alice: Caller, stored: str) -> None:
    """HEAD does not follow a running fit."""
    fit = alice.begin(stored, seed=10_000)
    began = time.monotonic()

    answer = alice.http.head(f"/fits/{fit['id']}/events")

    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert time.monotonic() - began < 5.0
    alice.http.delete(f"/fits/{fit['id']}")


def test_head_of_an_unknown_item_is_not_found(alice: Caller) -> None:
    """HEAD returns 404 wherever GET does."""
    assert alice.http.head("/runs/nothing").status_code == 404
    assert alice.http.head("/nothing").status_code == 404


def test_two_lengths_of_one_body_are_refused_and_the_connection_ends(server: Server) -> None:
    """RFC 9112, section 6.3: 400, and the rest is not parsed as another request."""
    request = (
        b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
        b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\nGET /healthz HTTP/1.1\r\n"
        b"Host: localhost\r\n\r\n"
    )

    answer = raw(server, request)

    assert answer.startswith(b"HTTP/1.1 400 "), answer[:200]
    assert b"connection: close" in answer.lower()
    assert answer.count(b"HTTP/1.1 ") == 1


def test_cookie_of_many_backslashes_does_not_block(server: Server) -> None:
    """CVE-2024-7592: 60 kB of backslashes once blocked the service for 23 s without a key."""
    cookie = 'a="' + "\\1" * 30_000 + '"'
    began = time.monotonic()

    answer = httpx.get(f"{server.url}{API}/runs", headers={"Cookie": cookie}, timeout=60)

    assert_is_problem(answer, 401)
    assert time.monotonic() - began < 5.0


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
def test_malformed_http_is_refused_and_the_server_survives(
    server: Server, request_bytes: bytes
) -> None:
    """The response is 4xx or a closed connection, and health answers afterwards."""
    answer = raw(server, request_bytes)

    assert answer == b"" or answer.startswith(b"HTTP/1.1 4"), answer[:200]
    assert httpx.get(f"{server.url}/healthz").status_code == 200


def test_no_earlier_request_caused_a_server_error(server: Server) -> None:
    """The log of this session contains no status 500 or above."""
    lines = [json.loads(line) for line in list(server.log) if line.startswith("{")]

    failed = [line for line in lines if line.get("status", 0) >= 500]
    assert failed == [], "\n".join(map(json.dumps, failed))
    for line in lines:
        # uvicorn rejects a malformed chunk itself and logs our later response as an error.
        assert "LocalProtocolError" in line.get("exception", "LocalProtocolError")

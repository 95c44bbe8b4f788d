"""Slow clients without a key: their connections are closed, and others are answered."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from tests.app.service import API, Caller, Server, make_key, serving
from tests.contract.hostile import FILE, RUN, form

REQUEST_S = 1.0
DESCRIPTORS = 200


@pytest.fixture(scope="module")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Server with a limit of 1 s for a request, and 4 s or 2 s without a byte for an upload."""
    data_dir = tmp_path_factory.mktemp("hasty") / "data"
    make_key(data_dir)
    settings = {"REQUEST_S": REQUEST_S, "UPLOAD_IDLE_S": 2.0, "UPLOAD_S": 4.0, "UPLAOD_S": 1.0}
    with serving(data_dir, **settings) as running:
        yield running


def connected(server: Server) -> socket.socket:
    """Connection to a server."""
    address = urlsplit(server.url)
    return socket.create_connection((address.hostname, address.port), timeout=15)


def until_closed(connection: socket.socket) -> tuple[bytes, float]:
    """Bytes received until the server closes the connection, and the time this took [s]."""
    began, answer = time.monotonic(), b""
    with contextlib.suppress(ConnectionResetError):
        while block := connection.recv(65536):
            answer += block
    return answer, time.monotonic() - began


def head(method: str, path: str, length: int, *more: str) -> bytes:
    """Headers of a request that announces a body."""
    lines = [f"{method} {path} HTTP/1.1", "Host: localhost", f"Content-Length: {length}", *more]
    return "\r\n".join([*lines, "", ""]).encode()


FORM = "Content-Type: application/x-www-form-urlencoded"


@pytest.mark.parametrize("begins", [b"", b"key="], ids=["nothing", "4 of 50 bytes"])
def test_stalled_body_answers_408(hasty: Server, begins: bytes) -> None:
    """After the time limit the response is a problem, and the connection is closed."""
    with connected(hasty) as connection:
        connection.sendall(head("POST", "/login", 50, FORM) + begins)
        answer, took_s = until_closed(connection)

    assert answer.startswith(b"HTTP/1.1 408 "), answer
    assert b"connection: close" in answer.lower()
    assert b"application/problem+json" in answer
    assert b'"code":"too_slow"' in answer
    assert took_s == pytest.approx(REQUEST_S, abs=0.9)


def test_slow_body_answers_408(hasty: Server) -> None:
    """A byte every 0.2 s does not extend the limit, even with a valid key."""
    key = make_key(hasty.data_dir, "drip")
    more = ("Content-Type: application/json", f"Authorization: Bearer {key}")
    with connected(hasty) as connection:
        connection.sendall(head("POST", f"{API}/fits", 5000, *more))
        began = time.monotonic()
        connection.settimeout(0.2)
        answer = b""
        while not answer and time.monotonic() - began < 10.0:
            connection.sendall(b" ")
            with contextlib.suppress(TimeoutError):
                answer = connection.recv(65536)

    assert answer.startswith(b"HTTP/1.1 408 "), answer
    assert time.monotonic() - began < REQUEST_S + 2.0


@pytest.mark.parametrize(
    "begins",
    [b"", b"GET /healthz HTTP/1.1\r\nHost: loc", head("GET", "/healthz", 50) + b"four"],
    ids=["nothing", "half the headers", "a body that nobody reads"],
)
def test_connection_without_a_whole_request_is_closed(hasty: Server, begins: bytes) -> None:
    """Bytes in between do not extend the limit of an incomplete request."""
    with connected(hasty) as connection:
        connection.sendall(begins)
        time.sleep(0.6 * REQUEST_S)
        if begins:
            connection.sendall(b"x")
        answer, took_s = until_closed(connection)

    assert answer == b"" or answer.startswith(b"HTTP/1.1 200 ")
    assert took_s < REQUEST_S + 1.0


def test_upload_may_take_longer(hasty: Server) -> None:
    """An upload may pause for longer than the limit of other requests."""
    body = form((FILE, RUN))

    def parts() -> Iterator[bytes]:
        yield body[:1000]
        time.sleep(1.5 * REQUEST_S)
        yield body[1000:]

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    with Caller(hasty, make_key(hasty.data_dir, "patient")) as caller:
        assert caller.http.post("/runs", content=parts(), headers=headers).status_code == 201


def test_slow_upload_answers_408(hasty: Server) -> None:
    """With steady bytes the limit of the whole upload applies."""
    key = make_key(hasty.data_dir, "slow")
    with connected(hasty) as connection:
        more = ("Content-Type: multipart/form-data; boundary=b", f"Authorization: Bearer {key}")
        connection.sendall(head("POST", f"{API}/runs", 5000, *more))
        began, answer = time.monotonic(), b""
        connection.settimeout(0.2)
        while not answer and time.monotonic() - began < 10.0:
            connection.sendall(b"-")
            with contextlib.suppress(TimeoutError):
                answer = connection.recv(65536)
        took_s = time.monotonic() - began
        connection.settimeout(15)
        answer += until_closed(connection)[0]

    assert answer.startswith(b"HTTP/1.1 408 "), answer
    assert b"the upload was not complete after 4 s" in answer
    assert 4.0 <= took_s < 7.0
    told = [line for line in hasty.log if "MOTORID_UPLAOD_S sets nothing" in line]
    assert len(told) == 1
    assert "the nearest setting is MOTORID_UPLOAD_S" in told[0]


class Narrow(Server):
    """Server with few file descriptors."""

    command = (
        f"import resource; resource.setrlimit(resource.RLIMIT_NOFILE, ({DESCRIPTORS},) * 2); "
        + Server.command
    )


def test_exhausted_descriptors_leave_health_and_log_intact(data_dir: Path) -> None:
    """The number of stalled requests is twice that of the descriptors; the server recovers."""
    make_key(data_dir)
    server = Narrow(data_dir, REQUEST_S=8.0)
    refused = healthy = 0
    try:
        with contextlib.ExitStack() as connections:
            for _ in range(2 * DESCRIPTORS):
                one = connections.enter_context(connected(server))
                with contextlib.suppress(OSError):
                    one.sendall(head("POST", "/login", 50, FORM) + b"key=")
            for _ in range(5):
                with contextlib.suppress(httpx.TransportError):
                    healthy += httpx.get(f"{server.url}/healthz").status_code == 200
                    refused += httpx.get(f"{server.url}/login").status_code == 503
        after, deadline = 503, time.monotonic() + 30.0
        while after == 503 and time.monotonic() < deadline:
            time.sleep(0.2)
            after = httpx.get(f"{server.url}/login").status_code
    finally:
        server.stop()

    assert (healthy, refused) == (5, 5)
    assert after == 200
    assert not [line for line in server.log if "out of system resource" in line]
    assert not [line for line in server.log if "Traceback" in line]

"""Helpers for tests of malformed and hostile requests."""

from __future__ import annotations

import contextlib
import errno
import socket
from urllib.parse import urlsplit

import httpx

from tests.app.service import Server, run_text

UNKNOWN = "run_" + "a" * 26
JSON = {"Content-Type": "application/json"}
FILE = 'Content-Disposition: form-data; name="file"; filename="a.csv"'
RUN = run_text(99)


def assert_is_problem(answer: httpx.Response, *statuses: int) -> None:
    """Check the status and form of a problem response, and that it reveals no internals."""
    assert answer.status_code in statuses, (answer.status_code, answer.text[:500])
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == answer.status_code
    assert {"type", "title", "detail", "code", "request_id"} <= problem.keys()
    assert "Traceback" not in answer.text
    assert "site-packages" not in answer.text


def form(*parts: tuple[str, bytes], end: bytes = b"--b--\r\n") -> bytes:
    """Multipart form built from the header and the content of each part."""
    return (
        b"".join(
            b"--b\r\n" + head.encode("utf-8", "surrogateescape") + b"\r\n\r\n" + content + b"\r\n"
            for head, content in parts
        )
        + end
    )


def raw(server: Server, request: bytes, *, then: bytes = b"") -> bytes:
    """Response to arbitrary bytes, which no client library would send."""
    address = urlsplit(server.url)
    with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
        answer = b""
        connection.sendall(request)
        if then:
            connection.sendall(then)
        try:
            connection.shutdown(socket.SHUT_WR)
        except OSError as error:
            # The server has already closed the connection.
            if error.errno != errno.ENOTCONN:
                raise
        # The server may close it before all bytes are sent.
        with contextlib.suppress(ConnectionResetError):
            while block := connection.recv(65536):
                answer += block
    return answer

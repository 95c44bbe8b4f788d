"""Proxy of the service that loses or replaces responses."""

from __future__ import annotations

from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx

from tests.app.service import Server


class Bad(ThreadingHTTPServer):
    """Proxy of the service that drops or replaces the first responses.

    Args:
        server: The service.
    """

    daemon_threads = True

    def __init__(self, server: Server) -> None:
        self.faults: list[Callable[[BaseHTTPRequestHandler], None]] = []
        self.seen: list[str] = []
        self.target = server.url
        super().__init__(("127.0.0.1", 0), Passing)
        self.url = f"http://127.0.0.1:{self.server_address[1]}"


class Passing(BaseHTTPRequestHandler):
    """Handler that forwards a call and then applies the next fault to its response."""

    def pass_on(self) -> None:
        """Forward a call."""
        assert isinstance(self.server, Bad)
        self.server.seen.append(self.command)
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        # The service would reject the Host header of the proxy.
        headers = {n: v for n, v in self.headers.items() if n.lower() != "host"}
        answer = httpx.request(
            self.command, self.server.target + self.path, content=body, headers=headers
        )
        fault = self.server.faults.pop(0) if self.server.faults else whole
        if fault is not whole:
            fault(self)
            return
        self.send_response(answer.status_code)
        self.send_header("Content-Type", answer.headers.get("content-type", ""))
        self.send_header("Content-Length", str(len(answer.content)))
        self.end_headers()
        self.wfile.write(answer.content)

    do_GET = do_POST = do_DELETE = pass_on  # noqa: N815  the names that the base class calls

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  the base class's name
        """Suppress the log."""


def whole(handler: BaseHTTPRequestHandler) -> None:
    """Pass the response on unchanged."""


def lost(handler: BaseHTTPRequestHandler) -> None:
    """Close the connection before the response."""
    handler.close_connection = True


def not_now(seconds: str) -> Callable[[BaseHTTPRequestHandler], None]:
    """Fault that returns 503 with a Retry-After header."""

    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(503)
        handler.send_header("Retry-After", seconds)
        handler.send_header("Content-Length", "0")
        handler.end_headers()

    return answer

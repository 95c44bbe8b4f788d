"""Health check of the container, with ready, unready and unreachable services."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from app.health.probe import unready
from tests.app.cluster import free_port
from tests.app.service import serving


class Unready(BaseHTTPRequestHandler):
    """Handler that answers like a service without a database."""

    def do_GET(self) -> None:
        """Answer 503 with the reason."""
        self.send_response(503)
        self.end_headers()
        self.wfile.write(b'{"status":"not ready"}')

    def log_message(self, *_: object) -> None:
        """Suppress the log."""


@contextmanager
def unready_server() -> Iterator[int]:
    """Port of a server that is not ready."""
    with HTTPServer(("127.0.0.1", 0), Unready) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


def test_probe_uses_the_port_and_works_with_any_allowed_hosts(tmp_path: Path) -> None:
    """The probe reads the variables of the service; its address need not be an allowed host."""
    with serving(tmp_path, "--no-auth", ALLOWED_HOSTS="motor.example") as server:
        port = str(urlsplit(server.url).port)
        told = unready({"MOTORID_HOST": "127.0.0.1", "MOTORID_PORT": port})

    assert told is None


def test_unready_service_is_reported_with_its_response() -> None:
    """One line gives the status and the reason of the service."""
    with unready_server() as port:
        told = unready({"MOTORID_PORT": str(port)})

    assert told == '/readyz answers 503: {"status":"not ready"}'


def test_unreachable_address_is_named() -> None:
    """This holds for a closed port and for a port that is no number."""
    port = free_port()

    assert str(unready({"MOTORID_PORT": str(port)})).startswith(
        f"127.0.0.1 port {port} does not answer ("
    )
    assert "see MOTORID_PORT" in str(unready({"MOTORID_PORT": "http"}))

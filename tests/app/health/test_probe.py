"""The health check of the container, against a service that is ready and against what is not."""

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
    """Answers as a service does whose database is gone."""

    def do_GET(self) -> None:
        """503 with a word why."""
        self.send_response(503)
        self.end_headers()
        self.wfile.write(b'{"status":"not ready"}')

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def unready_server() -> Iterator[int]:
    """Port of a server that is not ready."""
    with HTTPServer(("127.0.0.1", 0), Unready) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


def test_service_is_ready_on_the_port_that_is_set_whatever_names_it_has(tmp_path: Path) -> None:
    """The variables that the service has; its list of names does not hold the probe's address."""
    with serving(tmp_path, "--no-auth", ALLOWED_HOSTS="motor.example") as server:
        port = str(urlsplit(server.url).port)
        told = unready({"MOTORID_HOST": "127.0.0.1", "MOTORID_PORT": port})

    assert told is None


def test_what_is_not_ready_is_said_with_its_answer() -> None:
    """On one line, with the status and the words of the service."""
    with unready_server() as port:
        told = unready({"MOTORID_PORT": str(port)})

    assert told == '/readyz answers 503: {"status":"not ready"}'


def test_where_nothing_answers_the_address_is_named() -> None:
    """A port that was free a moment ago; and one that is no number."""
    port = free_port()

    assert str(unready({"MOTORID_PORT": str(port)})).startswith(
        f"127.0.0.1 port {port} does not answer ("
    )
    assert "see MOTORID_PORT" in str(unready({"MOTORID_PORT": "http"}))

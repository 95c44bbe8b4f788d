"""HTTP server: run the application under uvicorn until a signal stops it."""

from __future__ import annotations

import logging
import os
import signal
import socket
import sys
import time
from types import FrameType

import uvicorn

from app.composition import Services
from app.http.connections import accepted_at_once, connection_class
from app.logging import configure_logging
from app.main import create_app
from app.settings import Settings, unknown_variables

__all__ = ["serve"]

_log = logging.getLogger(__name__)
_WAITING = 2048


class _Server(uvicorn.Server):
    """Server that ends open event streams at shutdown, so that it need not wait for them."""

    services: Services
    told_at: float | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start serving; the listen backlog is larger than the number accepted at once."""
        await super().startup(sockets)
        for listening in sockets or ():
            listening.listen(_WAITING)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Begin the shutdown."""
        self.told_at = time.monotonic()
        _log.info("stopping", extra={"signal": signal.Signals(sig).name})
        self.services.stopping.set()
        super().handle_exit(sig, frame)


def serve(settings: Settings, listening: socket.socket) -> None:
    """Serve on a bound socket until SIGTERM, SIGINT or SIGHUP; running fits wait for a new start.

    Raises:
        OptionError: The data directory is unusable or in use by another server, or the database
            does not respond.
        DamagedDatabase: The database file is damaged or missing.
    """
    configure_logging(settings.log_level)
    for name, nearest in unknown_variables(os.environ).items():
        _log.warning("%s sets nothing; the nearest setting is %s", name, nearest)
    application = create_app(settings)
    services: Services = application.state.services
    # Open here: an error in the lifespan would appear as a traceback.
    services.open()
    _show_address(listening)
    server = _Server(
        uvicorn.Config(
            application,
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            ws="none",
            http=connection_class(settings.request_s),
            backlog=accepted_at_once(),
            lifespan="on",
            timeout_graceful_shutdown=max(1, round(settings.shutdown_s)),
        )
    )
    server.services = services
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup sets it
        signal.signal(signal.SIGHUP, server.handle_exit)
    try:
        server.run(sockets=[listening])
    finally:
        if server.told_at is not None:
            seconds = round(time.monotonic() - server.told_at, 3)
            _log.info("stopped", extra={"seconds": seconds})


def _show_address(listening: socket.socket) -> None:
    """Print the URL of the service once its address is reserved."""
    address, number = listening.getsockname()[:2]
    shown = f"[{address}]" if ":" in address else address
    print(f"motorid: http://{shown}:{number}", file=sys.stderr, flush=True)  # noqa: T201

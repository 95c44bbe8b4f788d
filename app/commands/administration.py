"""Administration of the HTTP service: run it, and open its data directory for its owner only."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sqlalchemy.exc import DatabaseError

from app.access.service import AccessService
from app.commands.exits import Terminated
from app.commands.loading import loading
from app.damage import DamagedDatabase, check_present, is_damaged
from app.database import Database
from app.settings import Settings, load_settings
from app.storage import Storage
from identification.errors import OptionError

__all__ = ["date", "open_access", "owner_only", "serve"]


def serve(
    *, host: str | None, port: int | None, data_dir: Path | None, no_auth: bool | None
) -> None:
    """Run the service until it is stopped by a signal."""
    settings = load_settings(host=host, port=port, data_dir=data_dir, no_auth=no_auth)
    listening = _listen(settings)
    # Local import: the key commands do not need the server.
    with loading():
        from app.server import serve as run

    # Signals are the normal end of a server; it has shut down cleanly by then.
    with listening, suppress(KeyboardInterrupt, Terminated), owner_only():
        run(settings, listening)


@contextmanager
def owner_only() -> Iterator[None]:
    """Set a umask that gives access to the owner only.

    An existing data directory may be open to all users, and holds runs and hashes of keys.
    """
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)


@contextmanager
def open_access(data_dir: Path | None) -> Iterator[AccessService]:
    """Open the keys in the data directory."""
    settings = load_settings(data_dir=data_dir)
    with owner_only():
        storage = Storage(settings.data_dir, settings.node)
        storage.prepare()
        if settings.sqlite_file is not None:
            check_present(settings.sqlite_file, storage.stored())
        database = Database(settings.sqlalchemy_url)
        try:
            database.migrate()
            yield AccessService(database)
        except DatabaseError as error:
            if not is_damaged(error):
                raise
            raise DamagedDatabase(database.url.database, f"is damaged ({error.orig})") from error
        finally:
            database.close()


def _listen(settings: Settings) -> socket.socket:
    """Socket bound to the address; called before any component of the service is started."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            settings.host.strip("[]"), settings.port, type=socket.SOCK_STREAM
        )[0]
        listening = socket.socket(family, kind, protocol)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
    except OSError as error:
        raise OptionError(
            f"{settings.host} port {settings.port} cannot be opened ({error.strerror}); "
            "choose another --host or --port",
            value=settings.port,
        ) from error
    return listening


def date(seconds: float) -> str:
    """Time in seconds since 1970 in UTC, ISO 8601."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))

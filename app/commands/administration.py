"""Commands of the HTTP service: run, manage API keys, back up and restore."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sqlalchemy.exc import DatabaseError

from app.access.service import AccessService
from app.commands.exits import Terminated
from app.damage import DamagedDatabase, check_present, is_damaged
from app.database import Database
from app.settings import Settings, load_settings
from app.storage import Storage
from identification.errors import OptionError

__all__ = ["back_up", "create_key", "list_keys", "restore", "revoke_key", "serve"]


def serve(
    *, host: str | None, port: int | None, data_dir: Path | None, no_auth: bool | None
) -> None:
    """Run the service until it is stopped by a signal.

    Raises:
        OptionError: A setting is not accepted, or the port cannot be listened on.
    """
    settings = load_settings(host=host, port=port, data_dir=data_dir, no_auth=no_auth)
    listening = _listen(settings)
    # Local import: the key commands do not need the server.
    from app.server import serve as run

    # Signals are the normal end of a server; it has shut down cleanly by then.
    with listening, suppress(KeyboardInterrupt, Terminated), _for_the_owner():
        run(settings, listening)


def create_key(
    name: str, workspace: str, days: float | None, data_dir: Path | None, *, owner: bool
) -> None:
    """Create an API key and print it."""
    with _access(data_dir) as access:
        key, secret = access.create_key(name, workspace, days=days, owner=owner)
    print(secret)  # noqa: T201
    until = "" if key.expires_at is None else f" until {_date(key.expires_at)}"
    print(  # noqa: T201
        f"motorid: created {key.id} for the workspace {workspace}{until}; the secret is not "
        "shown again",
        file=sys.stderr,
    )


def list_keys(data_dir: Path | None) -> None:
    """Print all keys, one per line, with tab-separated columns."""
    with _access(data_dir) as access:
        rows = access.list_keys()
    dates = ("created", "revoked", "expires", "last_used")
    print("id", "workspace", "name", *dates, "owner", sep="\t")  # noqa: T201
    for row in rows:
        moments = (getattr(row, f"{name}_at") for name in dates)
        shown = ("" if moment is None else _date(moment) for moment in moments)
        print(row.id, row.workspace, row.name, *shown, "yes" if row.owner else "no", sep="\t")  # noqa: T201


def revoke_key(key: str, data_dir: Path | None) -> None:
    """Revoke a key."""
    with _access(data_dir) as access:
        access.revoke_key(key)


def back_up(place: Path, data_dir: Path | None) -> None:
    """Write a backup and print a summary."""
    from app.backup.create import back_up as save

    with _for_the_owner():
        saved = save(load_settings(data_dir=data_dir), place)
    text = f"{saved.runs} runs and {saved.fits} results in {saved.files} files"
    print(f"motorid: {place} contains {text} and their SHA-256", file=sys.stderr)  # noqa: T201


def restore(place: Path, data_dir: Path | None) -> None:
    """Create a data directory from a backup and print a summary."""
    from app.backup.restore import restore as write

    settings = load_settings(data_dir=data_dir)
    with _for_the_owner():
        saved = write(settings, place)
    text = f"{saved.runs} runs and {saved.fits} results in {saved.files} files"
    print(f"motorid: {settings.data_dir} contains {text}, all verified", file=sys.stderr)  # noqa: T201


@contextmanager
def _for_the_owner() -> Iterator[None]:
    """Set a umask that gives access to the owner only.

    An existing data directory may be open to all users, and holds runs and hashes of keys.
    """
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)


@contextmanager
def _access(data_dir: Path | None) -> Iterator[AccessService]:
    settings = load_settings(data_dir=data_dir)
    with _for_the_owner():
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


def _date(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))

"""The commands of the HTTP service: `serve`, `backup`, `restore` and `keys`."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands import options
from app.commands.exits import Terminated
from app.commands.loading import loading
from identification.errors import OptionError

if TYPE_CHECKING:
    from app.access.service import AccessService
    from app.settings import Settings

__all__ = ["backup", "keys", "restore", "serve"]

keys = typer.Typer(help="API keys of the HTTP service.", rich_markup_mode=None)


def serve(
    host: Annotated[
        str | None, typer.Option(help="Address to listen on.  [default: 127.0.0.1]")
    ] = None,
    port: Annotated[
        int | None, typer.Option(help="Port to listen on; 0 selects a free port.  [default: 8000]")
    ] = None,
    data_dir: options.DataDir = None,
    no_auth: Annotated[
        bool,
        typer.Option(
            "--no-auth", help="Accept requests without an API key; only on a loopback address."
        ),
    ] = False,
) -> None:
    """Run the HTTP service.  MOTORID_ environment variables supply all other settings."""
    with loading():
        from app.settings import load_settings

    settings = load_settings(host=host, port=port, data_dir=data_dir, no_auth=no_auth or None)
    listening = _listen(settings)
    with loading():
        from app.server import serve as run

    # Signals are the normal end of a server; it has shut down cleanly by then.
    with listening, suppress(KeyboardInterrupt, Terminated), _owner_only():
        run(settings, listening)


def backup(
    archive: Annotated[
        Path,
        typer.Argument(
            metavar="BACKUP", help="New directory, or new file with a name that ends with .tar."
        ),
    ],
    data_dir: options.DataDir = None,
) -> None:
    """Back up the service's database, runs and results, even while the service runs."""
    from app.backup.create import back_up
    from app.settings import load_settings

    with _owner_only():
        saved = back_up(load_settings(data_dir=data_dir), archive)
    print(f"motorid: {archive} contains {saved} and their SHA-256", file=sys.stderr)  # noqa: T201


def restore(
    archive: Annotated[
        Path, typer.Argument(metavar="BACKUP", help="Backup made by 'motorid backup'.")
    ],
    data_dir: options.DataDir = None,
) -> None:
    """Create a data directory from a backup after checking every file; nothing is overwritten."""
    from app.backup.restore import restore as write
    from app.settings import load_settings

    settings = load_settings(data_dir=data_dir)
    with _owner_only():
        saved = write(settings, archive)
    print(f"motorid: {settings.data_dir} contains {saved}, all verified", file=sys.stderr)  # noqa: T201


@keys.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Display name, such as the name of the test bench.")],
    workspace: Annotated[
        str, typer.Option(help="Workspace whose runs and fits the key gives access to.")
    ] = "default",
    days: Annotated[
        float | None, typer.Option(help="Lifetime in days.  [default: unlimited]")
    ] = None,
    owner: Annotated[
        bool, typer.Option(help="Whether the key manages the keys of its workspace on /keys.")
    ] = True,
    data_dir: options.DataDir = None,
) -> None:
    """Create an API key.  It is printed once and cannot be shown again."""
    with _open_access(data_dir) as access:
        key, secret = access.create_key(name, workspace, days=days, owner=owner)
    print(secret)  # noqa: T201
    until = "" if key.expires_at is None else f" until {_date(key.expires_at)}"
    print(  # noqa: T201
        f"motorid: created {key.id} for the workspace {workspace}{until}; the secret is not "
        "shown again",
        file=sys.stderr,
    )


@keys.command("list")
def list_keys(data_dir: options.DataDir = None) -> None:
    """List all keys with workspace, expiry and last use, but not their secrets."""
    with _open_access(data_dir) as access:
        rows = access.list_keys()
    dates = ("created", "revoked", "expires", "last_used")
    print("id", "workspace", "name", *dates, "owner", sep="\t")  # noqa: T201
    for row in rows:
        moments = (getattr(row, f"{name}_at") for name in dates)
        shown = ("" if moment is None else _date(moment) for moment in moments)
        print(row.id, row.workspace, row.name, *shown, "yes" if row.owner else "no", sep="\t")  # noqa: T201


@keys.command("revoke")
def revoke_key(
    key: Annotated[str, typer.Argument(help="Id of the key, from 'motorid keys list'.")],
    data_dir: options.DataDir = None,
) -> None:
    """Revoke a key and end its sessions."""
    with _open_access(data_dir) as access:
        access.revoke_key(key)


@contextmanager
def _owner_only() -> Iterator[None]:
    """Set a umask that gives access to the owner only.

    An existing data directory may be open to all users, and holds runs and hashes of keys.
    """
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)


@contextmanager
def _open_access(data_dir: Path | None) -> Iterator[AccessService]:
    # Local imports, here and below: the help of a command needs none of these.
    from sqlalchemy.exc import DatabaseError

    from app.access.service import AccessService
    from app.damage import DamagedDatabase, check_present, is_damaged
    from app.database import Database
    from app.settings import load_settings
    from app.storage import Storage

    settings = load_settings(data_dir=data_dir)
    with _owner_only():
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
            "choose another --host or --port"
        ) from error
    return listening


def _date(seconds: float) -> str:
    """Time in seconds since 1970 in UTC, ISO 8601."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))

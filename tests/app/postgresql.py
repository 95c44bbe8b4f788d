"""Temporary PostgreSQL server on loopback, with a free port.

    with PostgresServer.running() as server:
        url = server.new_database()

The server refuses to run as root, so root starts it under an unprivileged account.  That account
must be able to read the data, which therefore lie in a separate directory below the system's
temporary directory: pytest denies other users access to its own.
"""

from __future__ import annotations

import itertools
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import psycopg

__all__ = ["MISSING", "PostgresServer"]

_NAMES = ("postgres", "nobody")
_FOLDERS = (*sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True), Path("/usr/bin"))


def _binaries() -> Path | None:
    found = shutil.which("initdb")
    # Resolve the link: the other programs are in the same directory as its target.
    folders = (*_FOLDERS, *([Path(found).resolve().parent] if found else []))
    for folder in folders:
        if all((folder / name).exists() for name in ("initdb", "pg_ctl", "postgres")):
            return folder
    return None


MISSING = None if _binaries() else "initdb, pg_ctl and postgres are not installed"
"""Reason why no server can be started, or None."""


class PostgresServer:
    """PostgreSQL server with a separate directory.

    Args:
        is_durable: Whether a commit waits for the disk (fsync).
    """

    password = "pa55-of-the-tests"  # noqa: S105  temporary server of the tests

    def __init__(self, *, is_durable: bool = False) -> None:
        binaries = _binaries()
        assert binaries is not None, MISSING
        self._binaries = binaries
        self._parent = Path(tempfile.mkdtemp(prefix="motorid-postgresql-"))
        self._directory = self._parent / "data"
        self._is_durable = is_durable
        self._account = _account()
        self._numbers = itertools.count()
        self.port = _free_port()

    @classmethod
    @contextmanager
    def running(cls, *, is_durable: bool = False) -> Iterator[Self]:
        """Run a server while the block runs, and delete its data afterwards."""
        server = cls(is_durable=is_durable)
        try:
            server._make()
            server.start()
            yield server
        finally:
            server.stop("immediate")
            shutil.rmtree(server._parent, ignore_errors=True)

    def url(self, database: str = "postgres") -> str:
        """URL of a database in the form that an operator would use."""
        return f"postgresql://motorid:{self.password}@127.0.0.1:{self.port}/{database}"

    def new_database(self) -> str:
        """Create an empty database and return its URL."""
        name = f"base_{next(self._numbers)}"
        with psycopg.connect(self.url(), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}".encode())
        return self.url(name)

    def start(self) -> None:
        """Start the server and wait until it responds."""
        settings = f"-p {self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories=''"
        if not self._is_durable:
            settings += " -c fsync=off"
        self._run("pg_ctl", "start", "-w", "-t", "60", "-l", self._log, "-o", settings)

    def stop(self, mode: str) -> None:
        """Stop the server: mode `fast` shuts down, mode `immediate` simulates a crash."""
        self._run("pg_ctl", "stop", "-w", "-m", mode)

    def restart(self, mode: str = "immediate") -> None:
        """Stop and start the server."""
        self.stop(mode)
        self.start()

    @property
    def _log(self) -> str:
        return str(self._directory / "server.log")

    def _make(self) -> None:
        secret = self._parent / "password"
        secret.write_text(self.password)
        if self._account is not None:
            for path in (self._parent, secret):
                os.chown(path, self._account.pw_uid, self._account.pw_gid)
        words = ("-U", "motorid", "-A", "scram-sha-256", "--pwfile", str(secret), "-E", "UTF8")
        self._run("initdb", *words, "--locale=C", "--no-sync")

    def _run(self, program: str, *words: str) -> None:
        account = self._account
        subprocess.run(
            [str(self._binaries / program), "-D", str(self._directory), *words],
            check=True,
            cwd="/",
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            user=None if account is None else account.pw_uid,
            group=None if account is None else account.pw_gid,
            extra_groups=None if account is None else [],
            env={"PATH": os.environ["PATH"], "LC_ALL": "C"},
        )


def _account() -> pwd.struct_passwd | None:
    if os.getuid() != 0:
        return None
    known = {entry.pw_name: entry for entry in pwd.getpwall()}
    return next(known[name] for name in _NAMES if name in known)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])

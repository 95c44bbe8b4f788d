"""Service with its database and engine on loopback, in which every process can be killed.

    with Rig.running(directory, database="postgresql", engine="dask") as rig:
        rig.kill("scheduler")

A killed process is started again, as by an init system or a cluster.
"""

from __future__ import annotations

import os
import random
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import psycopg

from benchmarks.torture import processes
from tests.app.cluster import Cluster
from tests.app.postgresql import PostgresServer
from tests.app.service import Server

__all__ = ["COMBINATIONS", "Rig"]

COMBINATIONS = (
    ("sqlite", "local"),
    ("postgresql", "local"),
    ("sqlite", "dask"),
    ("postgresql", "dask"),
)
"""Databases and engines."""

_MARK = "MOTORID_TORTURE"
_PATIENCE_S = 10.0


@dataclass
class Rig:
    """A server, its database and its engine.

    Args:
        data_dir: The data directory.
        settings: Settings of the server, without the prefix.
        mark: Text in the environment of every process, which identifies those left over.
        postgres: The database server, or None for SQLite.
        cluster: The cluster, or None for the local engine.
        log: Log lines of all servers so far.
    """

    data_dir: Path
    settings: Mapping[str, object]
    mark: str
    postgres: PostgresServer | None = None
    cluster: Cluster | None = None
    log: list[str] = field(default_factory=list)
    server: Server = field(init=False)

    @classmethod
    @contextmanager
    def running(
        cls, directory: Path, *, database: str, engine: str, **settings: object
    ) -> Iterator[Self]:
        """Provide a rig within a block.

        Args:
            directory: Directory of the data and of the cluster's files.
            database: ``sqlite`` or ``postgresql``.
            engine: ``local`` or ``dask``.
            **settings: Further settings of the server.
        """
        mark = secrets.token_hex(8)
        os.environ[_MARK] = mark
        with ExitStack() as stack:
            stack.callback(os.environ.pop, _MARK, None)
            chosen = dict(settings)
            rig = cls(directory / "data", chosen, mark)
            if database == "postgresql":
                rig.postgres = stack.enter_context(PostgresServer.running())
                chosen["DATABASE_URL"] = rig.postgres.new_database()
            if engine == "dask":
                rig.cluster = stack.enter_context(Cluster.running(directory / "dask", workers=2))
                chosen |= {"ENGINE": "dask", "DASK_SCHEDULER": rig.cluster.address}
            rig.start()
            stack.callback(rig.stop)
            yield rig

    def start(self) -> None:
        """Start the server and wait until it is ready."""
        self.server = Server(self.data_dir, "--no-auth", **self.settings)

    def stop(self) -> None:
        """Stop the server."""
        if self.server.process.poll() is None:
            self.server.stop()
        self.log += self.server.log
        self.server.log = []

    @property
    def url(self) -> str:
        """Address of the server, or its last one."""
        return self.server.url

    def targets(self) -> list[str]:
        """Names of the processes that can be killed."""
        found = ["server", "fork server", "child"]
        if self.postgres is not None:
            found += ["postgresql", "backend"]
        if self.cluster is not None:
            found += ["scheduler", "worker"]
        return found

    def kill(self, target: str, rng: random.Random) -> bool:
        """Kill a target and start it again; return False if none ran.

        Args:
            target: One of `targets`.
            rng: Selects one of several processes.
        """
        return bool(getattr(self, f"_kill_{target.replace(' ', '_')}")(rng))

    def left_over(self) -> list[int]:
        """Processes of this rig that still run."""
        return processes.marked(self.mark)

    def _kill_server(self, rng: random.Random) -> bool:
        self.server.kill()
        self.log += self.server.log
        self.start()
        return True

    def _fork_servers(self) -> list[int]:
        if self.cluster is None:
            return processes.fork_servers(self.server.process.pid)
        return [n for worker in self.cluster.workers for n in processes.fork_servers(worker.pid)]

    def _kill_fork_server(self, rng: random.Random) -> bool:
        found = self._fork_servers()
        return bool(found) and processes.kill(rng.choice(found))

    def _kill_child(self, rng: random.Random) -> bool:
        found: list[int] = []
        deadline = time.monotonic() + _PATIENCE_S
        while not found and time.monotonic() < deadline:
            time.sleep(0.01)
            found = [child for one in self._fork_servers() for child in processes.children(one)]
        return bool(found) and processes.kill(rng.choice(found))

    def _kill_postgresql(self, rng: random.Random) -> bool:
        assert self.postgres
        self.postgres.restart("immediate")
        return True

    def _kill_backend(self, rng: random.Random) -> bool:
        """Kill one process of the database, which then restarts itself."""
        assert self.postgres
        query = b"SELECT pid FROM pg_stat_activity WHERE application_name = 'motorid'"
        try:
            with psycopg.connect(self.postgres.url()) as connection:
                found = [row[0] for row in connection.execute(query)]
        except psycopg.OperationalError:
            # The database is still restarting after the previous kill.
            return False
        return bool(found) and processes.kill(rng.choice(found))

    def _kill_scheduler(self, rng: random.Random) -> bool:
        assert self.cluster
        self.cluster.kill_scheduler()
        self.cluster.tend()
        return True

    def _kill_worker(self, rng: random.Random) -> bool:
        assert self.cluster
        self.cluster.kill_worker(rng.randrange(len(self.cluster.workers)))
        self.cluster.start_worker()
        return True

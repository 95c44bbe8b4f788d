"""A cluster that is lost and comes back, and what must not happen meanwhile."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.fits.dask_engine import DaskEngine
from app.fits.dask_task import BEGUN
from app.fits.engine import LOST, AbstractRunning
from app.settings import load_settings
from app.storage import Storage
from tests.app.cluster import OPENSSL, Certificates, Cluster, free_port
from tests.app.fits.test_engine import ended, job, opened
from tests.app.pretended import QUICK, SLOW

FIT = "fit_" + "x" * 26


class Bench:
    """An engine with a cluster of its own and a data directory."""

    def __init__(self, directory: Path, address: str, **settings: object) -> None:
        self.storage = Storage(directory, "bench")
        self.storage.prepare()
        chosen = load_settings(engine="dask", dask_scheduler=address, **settings)
        self.engine = DaskEngine(chosen, self.storage)

    def start(self, seed: int, attempt: int, *, is_begun: bool = False) -> AbstractRunning:
        """Start an attempt; with `is_begun` as Dask does it again after it lost a worker."""
        directory = self.storage.attempt(FIT, attempt)
        directory.mkdir(parents=True)
        if is_begun:
            (directory / BEGUN).touch()
        return self.engine.start(job(directory, seed))


def until(condition: Callable[[], object]) -> None:
    """Wait for something that another process does."""
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A cluster that the test may break."""
    with Cluster.running(tmp_path / "cluster") as made:
        yield made


def test_lost_worker_and_lost_scheduler_lose_what_ran_and_nothing_else(
    tmp_path: Path, cluster: Cluster
) -> None:
    """Both attempts end as lost and not as crashed; each time the cluster is then used again."""
    bench = Bench(tmp_path / "data", cluster.address)
    with opened(bench.engine):
        first = bench.start(SLOW, 1)
        until(first.messages)
        cluster.kill_worker()
        until(first.exit)
        first.kill()
        cluster.start_worker()
        until(bench.engine.capacity)
        second = bench.start(SLOW, 2)
        until(second.messages)
        cluster.kill_scheduler()
        until(second.exit)
        second.kill()
        ends = [first.exit(), second.exit()]
        until(lambda: bench.engine.capacity() == 0)
        with pytest.raises(OSError, match="no connection to the scheduler"):
            bench.start(QUICK, 3)
        until(lambda: cluster.workers[0].poll() is not None)
        cluster.tend()
        until(bench.engine.capacity)
        end, told = ended(bench.start(QUICK, 4))

    assert ends == [LOST, LOST]
    assert (end, told[-1]) == ("exit status 0", {"done": True})
    assert not (bench.storage.attempt(FIT, 1) / "result.json").exists()


def test_attempt_is_begun_once_and_a_cluster_that_begins_nothing_is_given_time(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A task that Dask makes a second time is lost and touches nothing.

    Then the data directory vanishes under the worker, as a volume does that is not mounted: the
    attempt is lost before it began, and for a time there is no capacity.
    """
    bench = Bench(tmp_path / "data", cluster.address)
    with opened(bench.engine):
        end, _ = ended(bench.start(QUICK, 1, is_begun=True))
        left = {path.name for path in bench.storage.attempt(FIT, 1).iterdir()}
        capacity = bench.engine.capacity()
        running = bench.start(QUICK, 2)
        bench.storage.remove_attempt(FIT, 2)
        again = bench.engine.start(running.job)
        unplaced, _ = ended(again)

        assert end == LOST
        assert left == {"run", BEGUN}
        assert capacity == 2
        assert unplaced == LOST
        assert bench.engine.capacity() == 0
        until(bench.engine.capacity)
        running.kill()


@pytest.mark.skipif(OPENSSL is None, reason="openssl is not installed")
def test_cluster_with_certificates_takes_jobs_from_who_has_one(tmp_path: Path) -> None:
    """The same job over TLS; with a certificate of another authority there is no connection."""
    ours, others = (Certificates.made(tmp_path / name) for name in ("ours", "others"))
    with Cluster.running(tmp_path / "cluster", certificates=ours) as cluster:
        bench = Bench(tmp_path / "data", cluster.address, **files(ours))
        with opened(bench.engine):
            end, _ = ended(bench.start(QUICK, 1))
        stranger = Bench(tmp_path / "other", cluster.address, **files(others))
        stranger.engine.open()
        time.sleep(2.0)
        capacity = stranger.engine.capacity()
        stranger.engine.close()

    assert end == "exit status 0"
    assert capacity == 0


def files(certificates: Certificates) -> dict[str, object]:
    """The settings that name certificates."""
    return {
        "dask_tls_ca_file": certificates.ca,
        "dask_tls_cert_file": certificates.certificate,
        "dask_tls_key_file": certificates.key,
    }


def test_engine_without_a_scheduler_has_no_capacity_and_can_be_closed(tmp_path: Path) -> None:
    """Nothing listens on the port; opening does not wait, closing does not hang."""
    bench = Bench(tmp_path, f"tcp://127.0.0.1:{free_port()}")

    began = time.monotonic()
    bench.engine.open()
    opening = time.monotonic() - began
    capacity = bench.engine.capacity()
    bench.engine.close()

    assert opening < 0.5
    assert capacity == 0


def test_cluster_is_not_imported_where_one_machine_computes() -> None:
    """Its import takes a second of each start; a fresh interpreter is asked."""
    words = "import sys, app.composition, app.server; print('distributed' in sys.modules)"

    told = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)

    assert told.stdout.strip() == "False"

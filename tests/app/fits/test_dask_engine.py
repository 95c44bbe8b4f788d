"""Dask engine during failures of its cluster."""

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
    """Dask engine with a data directory."""

    def __init__(self, directory: Path, address: str, **settings: object) -> None:
        self.storage = Storage(directory, "bench")
        self.storage.prepare()
        chosen = load_settings(engine="dask", dask_scheduler=address, **settings)
        self.engine = DaskEngine(chosen, self.storage)

    def start(self, seed: int, attempt: int, *, is_begun: bool = False) -> AbstractRunning:
        """Start an attempt; `is_begun` simulates a task that Dask repeats after losing a worker."""
        directory = self.storage.attempt(FIT, attempt)
        directory.mkdir(parents=True)
        if is_begun:
            (directory / BEGUN).touch()
        return self.engine.start(job(directory, seed))


def until(condition: Callable[[], object]) -> None:
    """Wait until a condition holds, which another process brings about."""
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Cluster of one worker, which the test may kill."""
    with Cluster.running(tmp_path / "cluster") as made:
        yield made


def test_lost_worker_or_scheduler_loses_only_running_attempts(
    tmp_path: Path, cluster: Cluster
) -> None:
    """Both attempts end as lost, not as crashed; after the restart the cluster is used again."""
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


def test_attempt_starts_once_and_a_failing_cluster_is_paused(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A repeated task reports the attempt as lost and leaves its directory unchanged.

    If the worker does not find the directory, as with a missing volume, the attempt is lost
    before it starts, and the capacity is 0 for a time.
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
def test_tls_cluster_requires_a_certificate_of_its_authority(tmp_path: Path) -> None:
    """A certificate of another authority gives no connection."""
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
    """Settings for the certificate files."""
    return {
        "dask_tls_ca_file": certificates.ca,
        "dask_tls_cert_file": certificates.certificate,
        "dask_tls_key_file": certificates.key,
    }


def test_engine_without_a_scheduler_has_no_capacity_and_can_be_closed(tmp_path: Path) -> None:
    """Opening does not wait for an unreachable scheduler, and closing does not hang."""
    bench = Bench(tmp_path, f"tcp://127.0.0.1:{free_port()}")

    began = time.monotonic()
    bench.engine.open()
    opening = time.monotonic() - began
    capacity = bench.engine.capacity()
    bench.engine.close()

    assert opening < 0.5
    assert capacity == 0


def test_local_engine_does_not_import_dask() -> None:
    """The import would add a second to each start; a new interpreter is checked."""
    words = "import sys, app.composition, app.server; print('distributed' in sys.modules)"

    told = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)

    assert told.stdout.strip() == "False"

"""Backup of a busy service, and a service on the restored data."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from app.cli import main
from tests.app.pretended import QUICK, SLOW
from tests.app.service import Caller, Server, make_key, run_text, serving

LEASE = {"LEASE_S": 4, "HEARTBEAT_S": 1}
"""The restored service takes over the running fit when the lease of the first one has ended."""


def test_backup_of_a_busy_service_is_consistent(tmp_path: Path) -> None:
    """While runs are added and deleted, the backup contains each row with its file."""
    data_dir, saved = tmp_path / "data", str(tmp_path / "saved.tar")
    key = make_key(data_dir)
    with serving(data_dir, RATE_PER_S=0, **LEASE) as server, Caller(server, key) as caller:
        runs = [caller.upload(run_text(seed)) for seed in range(4)]
        ended = caller.wait(caller.begin(runs[0]["id"], seed=QUICK)["id"])
        slow = caller.begin(runs[1]["id"], seed=SLOW)["id"]
        is_over = threading.Event()
        busy = threading.Thread(target=upload_and_delete, args=(server, key, is_over))
        busy.start()
        assert main(["backup", saved, "--data-dir", str(data_dir)]) == 0
        is_over.set()
        busy.join()

    there = tmp_path / "there"
    assert main(["restore", saved, "--data-dir", str(there)]) == 0

    with serving(there, RATE_PER_S=0, **LEASE) as server, Caller(server, key) as caller:
        for run in runs:
            assert caller.http.get(f"/runs/{run['id']}").json() == run
        assert caller.fit(ended["id"]) == ended
        assert caller.http.get(f"/fits/{ended['id']}/report").status_code == 200
        assert caller.wait(slow)["status"] == "succeeded"
        listed = caller.http.get("/runs?limit=1000").json()["items"]
        kept = {path.name for path in (there / "runs").iterdir()}
        assert {run["id"] for run in listed} == kept
        for run in listed[:3]:
            again = caller.begin(run["id"], seed=QUICK)["id"]
            assert caller.wait(again)["status"] == "succeeded"


def upload_and_delete(server: Server, key: str, is_over: threading.Event) -> None:
    """Add and delete runs until told to stop."""
    with Caller(server, key) as caller:
        seed = 100
        while not is_over.is_set():
            seed += 1
            time.sleep(0.05)
            run = caller.upload(run_text(seed))["id"]
            if seed % 2:
                assert caller.http.delete(f"/runs/{run}").status_code == 204

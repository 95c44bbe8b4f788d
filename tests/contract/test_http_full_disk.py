"""Service on a full disk: reading and deleting work, everything else reports the cause."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.app.service import Caller, Server, run_text, serving


def fill(disk: Path) -> None:
    """Fill the file system to the last byte."""
    with (disk / "ballast").open("ab", buffering=0) as file:
        for size in (1 << 16, 1 << 12, 1):
            try:
                while True:
                    file.write(bytes(size))
            except OSError:
                continue


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """File system of four megabytes."""
    place = tmp_path / "disk"
    place.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=4m", "none", str(place)]
    try:
        subprocess.run(words, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("mounting is not allowed here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.fixture
def full(disk: Path) -> Iterator[Server]:
    """Server on a full disk with three runs and one fit of each."""
    with serving(disk / "data", "--no-auth") as server, Caller(server) as caller:
        for seed in range(3):
            caller.wait(caller.begin(caller.upload(run_text(seed, rows=2000))["id"])["id"])
        fill(disk)
        assert os.statvfs(disk).f_bavail == 0
        yield server


def ids(caller: Caller, kind: str) -> list[str]:
    """IDs of all runs or fits."""
    return [item["id"] for item in caller.http.get(f"/{kind}").json()["items"]]


def test_full_disk_is_not_ready_and_permits_reading_and_deletions(full: Server) -> None:
    """An upload returns 507 `storage_full`, and readiness fails until there is space.

    The disk is filled after each deletion, so that none uses space freed by another.
    """
    disk = full.data_dir.parent
    with Caller(full) as caller:
        ready = httpx.get(f"{full.url}/readyz")
        upload = caller.http.post("/runs", files={"file": ("run.csv", run_text(9))})
        read = [
            caller.http.get(f"/fits/{ids(caller, 'fits')[0]}{part}") for part in ("", "/report")
        ]

    assert (ready.status_code, ready.json()["checks"]["storage"]) == (503, False)
    assert (upload.status_code, upload.json()["code"]) == (507, "storage_full")
    assert {answer.status_code for answer in read} == {200}
    assert httpx.get(f"{full.url}/healthz").status_code == 200

    with Caller(full) as caller:
        for kind in ("fits", "runs"):
            for name in ids(caller, kind):
                assert caller.http.delete(f"/{kind}/{name}").status_code == 204
                fill(disk)
        (disk / "ballast").unlink()
        upload = caller.http.post("/runs", files={"file": ("run.csv", run_text(9))})

    assert httpx.get(f"{full.url}/readyz").status_code == 200
    assert upload.status_code == 201


def test_service_starts_on_a_full_disk(full: Server) -> None:
    """A user must be able to start the service and delete data."""
    full.stop()

    # The service does not become ready, so wait for its log.
    environment = os.environ | {"MOTORID_PORT": "0"}
    words = [*full.process.args]  # type: ignore[misc]
    with subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True) as again:
        try:
            assert again.stderr
            address = again.stderr.readline().split()[1]
            lines = iter(again.stderr.readline, "")
            assert any("startup complete" in line for line in lines)
            delete_all(f"{address}/api/v1")
        finally:
            again.terminate()


def delete_all(address: str) -> None:
    """Delete all fits and the newest run of a service, which may listen a moment later."""
    transport = httpx.HTTPTransport(retries=5)
    with httpx.Client(base_url=address, transport=transport) as client:
        run = client.get("/runs").json()["items"][0]["id"]
        for fit in client.get("/fits").json()["items"]:
            assert client.delete(f"/fits/{fit['id']}").status_code == 204
        assert client.delete(f"/runs/{run}").status_code == 204

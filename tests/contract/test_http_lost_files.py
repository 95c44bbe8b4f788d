"""Lost or damaged files of the data directory: reported with a code, restored if possible."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from motorid.errors import Busy
from tests.app.damaged import DAMAGES
from tests.app.service import Caller, Server, run_text, serving
from tests.contract.hostile import assert_is_problem

PATIENCE_S = 60.0
ADDRESSES = {"result.json": "", "report.html": "/report", "posterior.nc": "/posterior"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Service whose files are damaged; the log of the shared one contains no server error."""
    with serving(tmp_path_factory.mktemp("lost") / "data", "--no-auth") as running:
        yield running


@pytest.fixture(scope="module")
def alice(server: Server) -> Iterator[Caller]:
    """Its only client."""
    with Caller(server) as caller:
        yield caller


def fitted(alice: Caller, seed: int) -> str:
    """ID of a succeeded fit with its own run."""
    fit = alice.begin(alice.upload(run_text(seed))["id"])
    assert alice.wait(fit["id"])["status"] == "succeeded"
    return str(fit["id"])


def answer(alice: Caller, fit: str, name: str) -> httpx.Response:
    """Response to the request of an output."""
    return alice.http.get(f"/fits/{fit}{ADDRESSES[name]}")


@pytest.mark.parametrize("damage", DAMAGES)
def test_repeated_upload_restores_a_lost_run(server: Server, alice: Caller, damage: str) -> None:
    """The upload returns 200 with the same ID, and the file has its original bytes."""
    content = run_text(7_000 + list(DAMAGES).index(damage))
    run = alice.upload(content)["id"]
    path = server.data_dir / "runs" / run
    DAMAGES[damage](path)

    again = alice.http.post("/runs", files={"file": ("run.csv", content)})

    assert (again.status_code, again.json()["id"]) == (200, run)
    assert path.read_bytes() == content
    assert alice.wait(alice.begin(run)["id"])["status"] == "succeeded"


@pytest.mark.parametrize("damage", DAMAGES)
def test_fit_of_a_lost_run_names_the_remedy(server: Server, alice: Caller, damage: str) -> None:
    """A truncated table must not be fitted, because it would give another motor's parameters."""
    run = alice.upload(run_text(7_100 + list(DAMAGES).index(damage)), name="bench.csv")["id"]
    DAMAGES[damage](server.data_dir / "runs" / run)

    fit = alice.wait(alice.begin(run)["id"])

    assert fit["status"] == "failed"
    assert (fit["error"]["code"], fit["error"]["file"]) == ("file_lost", "bench.csv")
    assert "upload the same file again" in fit["error"]["detail"]
    assert alice.http.delete(f"/runs/{run}").status_code == 204
    assert not (server.data_dir / "runs" / run).exists()


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", ADDRESSES)
def test_lost_output_is_a_problem_with_a_code(
    server: Server, alice: Caller, name: str, damage: str
) -> None:
    """It returns 503 `file_lost`; the other outputs are served, and the fit can be deleted."""
    fit = fitted(alice, 7_200)
    DAMAGES[damage](server.data_dir / "fits" / fit / "1" / name)

    lost = answer(alice, fit, name)

    assert (lost.status_code, lost.json()["code"]) == (503, "file_lost")
    assert lost.headers["content-type"] == "application/problem+json"
    assert "retry-after" not in lost.headers
    assert name in lost.json()["detail"]
    assert "backup" in lost.json()["detail"]
    for other in ADDRESSES.keys() - {name}:
        assert answer(alice, fit, other).status_code == 200
    assert alice.http.delete(f"/fits/{fit}").status_code == 204
    assert not (server.data_dir / "fits" / fit).exists()


@pytest.mark.parametrize("place", ["1", ""])
def test_file_in_place_of_a_directory_is_a_lost_fit(
    server: Server, alice: Caller, place: str
) -> None:
    """A file system repair can leave such a file; the fit is lost and can be deleted."""
    fit = fitted(alice, 7_201)
    whole: Path = server.data_dir / "fits" / fit
    whole.rename(server.data_dir / "incoming" / fit)
    if place:
        whole.mkdir()
    (whole / place).write_bytes(b"")

    for name in ADDRESSES:
        assert answer(alice, fit, name).json()["code"] == "file_lost"
    assert alice.http.delete(f"/fits/{fit}").status_code == 204
    assert not whole.exists()


@pytest.mark.parametrize("damage", DAMAGES)
def test_table_of_a_batch_marks_a_lost_result(server: Server, alice: Caller, damage: str) -> None:
    """The row of the motor has an error; the other rows and the page are complete."""
    run = alice.upload(run_text(7_202))["id"]
    motors = [{"motor": name, "training": [run]} for name in ("a", "b")]
    batch = alice.http.post("/batches", json={"motors": motors}).json()
    lost, _ = (alice.wait(fit["fit"])["id"] for fit in batch["fits"])
    DAMAGES[damage](server.data_dir / "fits" / lost / "1" / "result.json")

    rows = alice.http.get(f"/batches/{batch['id']}/results").json()["rows"]

    errors = {row["motor"]: row["error"] for row in rows}
    assert "missing or damaged" in errors["a"]
    assert not errors["b"]
    for form in ("results.csv", "report"):
        assert alice.http.get(f"/batches/{batch['id']}/{form}").status_code == 200


def test_client_does_not_retry_a_lost_file(server: Server, alice: Caller) -> None:
    """A later response would be the same."""
    fit = fitted(alice, 7_203)
    (server.data_dir / "fits" / fit / "1" / "result.json").unlink()
    began = time.monotonic()

    with pytest.raises(Busy, match="is not in the data directory"):
        alice.client.show_fit(fit)

    assert time.monotonic() - began < PATIENCE_S / 2


def test_damaged_result_is_not_exported(server: Server, alice: Caller) -> None:
    """The checksum is verified before the export."""
    fit = fitted(alice, 7_202)
    path = server.data_dir / "fits" / fit / "1" / "result.json"
    path.write_bytes(path.read_bytes().replace(b"1", b"2"))

    damaged = alice.http.get(f"/fits/{fit}/exports/csv")

    assert_is_problem(damaged, 503)
    assert damaged.json()["code"] == "file_lost"

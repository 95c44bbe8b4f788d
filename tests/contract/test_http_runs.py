"""Runs over HTTP: upload, identity, errors, lists and deletion."""

from __future__ import annotations

import hashlib
import json

import pytest

from tests.app.pretended import SLOW
from tests.app.service import HEADER, Caller, Server, run_text

PROBLEM = "application/problem+json"


def test_upload_returns_a_summary_of_the_run(alice: Caller) -> None:
    """Hash, 60 rows, 1 kHz, 59 ms and temperature range match the file."""
    content = run_text(1)

    answer = alice.http.post(
        "/runs", files={"file": ("a.csv", content)}, data={"motor": "motor 17"}
    )

    run = answer.json()
    assert answer.status_code == 201
    assert answer.headers["location"] == f"/api/v1/runs/{run['id']}"
    assert run["sha256"] == hashlib.sha256(content).hexdigest()
    assert (run["rows"], run["file"], run["motor"]) == (60, "a.csv", "motor 17")
    assert run["bytes"] == len(content)
    assert run["sample_rate_hz"] == pytest.approx(1000.0)
    assert run["duration_s"] == pytest.approx(0.059)
    assert run["channels"]["temperature_degC"]["min"] == pytest.approx(25.0, abs=0.1)
    assert alice.http.get(f"/runs/{run['id']}").json() == run


def test_same_bytes_are_the_same_run(alice: Caller) -> None:
    """A repeated upload returns 200 with the same ID, whatever the file name."""
    first = alice.http.post("/runs", files={"file": ("a.csv", run_text(2))})

    second = alice.http.post("/runs", files={"file": ("b.csv", run_text(2))})

    assert (first.status_code, second.status_code) == (201, 200)
    assert second.json() == first.json()


def test_same_bytes_with_another_mapping_are_another_run(alice: Caller) -> None:
    """Twice the scale of the current doubles its range."""
    mapping = {"current_A": {"column": "current_A", "scale": 2.0}}
    plain = alice.upload(run_text(3))

    doubled = alice.upload(run_text(3), mapping=json.dumps(mapping))

    assert doubled["id"] != plain["id"]
    assert doubled["mapping"] == mapping
    for end in ("min", "max"):
        expected = 2.0 * plain["channels"]["current_A"][end]
        assert doubled["channels"]["current_A"][end] == pytest.approx(expected)


def test_workspaces_store_equal_runs_separately(alice: Caller, bob: Caller) -> None:
    """An upload does not reveal whether another workspace has the same bytes."""
    ours = alice.http.post("/runs", files={"file": ("a.csv", run_text(4))})
    theirs = bob.http.post("/runs", files={"file": ("a.csv", run_text(4))})

    assert (ours.status_code, theirs.status_code) == (201, 201)
    assert ours.json()["id"] != theirs.json()["id"]


def test_runs_are_listed_newest_first_in_pages(bob: Caller) -> None:
    """Pages of two list each run once, ordered by time."""
    made = [bob.upload(run_text(seed))["id"] for seed in range(10, 15)]
    listed: list[str] = []
    query: dict[str, str | int] = {"limit": 2}
    while True:
        page = bob.http.get("/runs", params=query).json()
        listed += [run["id"] for run in page["items"]]
        if page["next"] is None:
            break
        query["after"] = page["next"]

    assert listed[:5] == made[::-1]
    assert len(set(listed)) == len(listed)


def test_runs_are_listed_by_motor(alice: Caller) -> None:
    """The filter selects the runs uploaded for this motor."""
    run = alice.upload(run_text(20), motor="motor of this test")

    page = alice.http.get("/runs", params={"motor": "motor of this test"}).json()

    assert [entry["id"] for entry in page["items"]] == [run["id"]]


def test_deleted_run_is_gone_with_its_bytes(alice: Caller, server: Server) -> None:
    """The run gives 404, and its file is removed."""
    run = alice.upload(run_text(21))["id"]
    path = server.data_dir / "runs" / run
    assert path.read_bytes() == run_text(21)

    answer = alice.http.delete(f"/runs/{run}")

    assert answer.status_code == 204
    assert alice.http.get(f"/runs/{run}").status_code == 404
    assert not path.exists()


def test_fault_in_a_run_names_file_row_and_column(alice: Caller) -> None:
    """An invalid cell in line 5 of bench.csv is reported with file, row and column."""
    lines = run_text(22).decode().splitlines()
    cells = lines[4].split(",")
    lines[4] = ",".join([*cells[:2], "twelve", *cells[3:]])

    answer = alice.http.post("/runs", files={"file": ("bench.csv", "\n".join(lines))})

    problem = answer.json()
    assert answer.status_code == problem["status"] == 422
    assert answer.headers["content-type"] == PROBLEM
    assert (problem["file"], problem["row"], problem["column"]) == ("bench.csv", 5, "current_A")
    assert problem["code"] == "not_a_number"
    assert problem["type"] == "urn:motorid:problem:not_a_number"
    assert "twelve" in problem["detail"]


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "empty_file"),
        (b"\n\n\n", "empty_file"),
        (HEADER.encode() + b"\n", "no_rows"),
        (b"\x00" * 5000, "not_text"),
        (bytes(range(256)) * 40, "not_text"),
        (b"PK\x03\x04" + bytes(3000), "damaged_file"),
        (run_text(0).replace(b"voltage_V", b"tension"), "missing_column"),
        (run_text(0).replace(b"voltage_V", b"voltage [furlong]"), "unknown_unit"),
        (run_text(0).replace(b"0.005000,", b"nan,", 1), "not_finite"),
        (run_text(0).replace(b"0.005000,", b"0.004000,", 1), "repeated_time"),
        (run_text(0).replace(b"0.005000,", b"0.001000,", 1), "backward_time"),
        (b"x" * 900_000, None),
        (b"\n".join(run_text(0).splitlines()[:5]), "too_few_rows"),
    ],
)
def test_malformed_file_is_refused_and_leaves_nothing(
    alice: Caller, server: Server, content: bytes, code: str | None
) -> None:
    """The code is that of the reader; no file is added to the data directory."""
    before = sorted(path.name for path in server.data_dir.rglob("*"))

    answer = alice.http.post("/runs", files={"file": ("broken.csv", content)})

    assert answer.status_code == 422
    assert answer.headers["content-type"] == PROBLEM
    assert code in (None, answer.json()["code"]), answer.json()
    after = sorted(path.name for path in server.data_dir.rglob("*"))
    assert [n for n in after if n not in before and "journal" not in n] == []


def test_file_above_the_limit_is_refused(alice: Caller) -> None:
    """The test server accepts a million bytes; a larger file gives 413."""
    answer = alice.http.post("/runs", files={"file": ("big.csv", b"1,2,3\n" * 200_000)})

    assert answer.status_code == 413
    assert answer.headers["content-type"] == PROBLEM


def test_run_of_a_waiting_fit_is_kept(alice: Caller, stored: str) -> None:
    """Deletion returns 409 until the fit is cancelled."""
    run = alice.upload(run_text(23))["id"]
    fit = alice.begin(stored, run, seed=SLOW)["id"]

    refused = alice.http.delete(f"/runs/{run}")
    alice.http.delete(f"/fits/{fit}")
    accepted = alice.http.delete(f"/runs/{run}")

    assert refused.status_code == 409
    assert refused.json()["code"] == "run_in_use"
    assert fit in refused.json()["detail"]
    assert accepted.status_code == 204

"""Batches over HTTP: progress, results in each format, drift, fleet page and deletion."""

from __future__ import annotations

import csv
import io
import json
import time
from typing import Any

import pytest

from app.http.headers import FLEET_POLICY
from tests.app.pretended import NO_SOLUTION, QUICK, SLOW
from tests.app.service import Caller, run_text

parquet = pytest.importorskip("pyarrow.parquet")

FORMS = {
    "json": "application/json",
    "csv": "text/csv",
    "parquet": "application/vnd.apache.parquet",
}


def begin(caller: Caller, motors: list[dict[str, object]], **more: object) -> str:
    """Submit a batch and return its ID."""
    answer = caller.http.post("/batches", json={"motors": motors, **more})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def ended(caller: Caller, batch: str) -> dict[str, Any]:
    """Wait for the end of a batch and return it."""
    return dict(caller.client.wait_batch(batch, timeout_s=60).content)


@pytest.fixture(scope="module")
def runs(alice: Caller) -> list[str]:
    """Two runs with different first speeds, from which the mock pipeline computes Ra25."""
    return [str(alice.upload(run_text(700 + number))["id"]) for number in range(2)]


@pytest.fixture(scope="module")
def batch(alice: Caller, runs: list[str]) -> str:
    """ID of the second of two batches with the same motors."""
    first = [{"motor": f"drift {n}", "training": [runs[0]]} for n in range(2)]
    ended(alice, begin(alice, [dict(motor) for motor in first]))
    second: list[dict[str, object]] = [
        {"motor": "drift 0", "training": [runs[1]]},
        {"motor": "drift 1", "training": [runs[0]]},
        {"motor": "=drift()", "training": [runs[0]]},
        {"motor": "drift 3", "training": [runs[0]], "options": {"seed": NO_SOLUTION}},
    ]
    made = begin(alice, second, name="<b>second</b>")
    ended(alice, made)
    return made


def rows_of(alice: Caller, batch: str) -> list[dict[str, Any]]:
    """Rows of the results of a batch."""
    return list(alice.http.get(f"/batches/{batch}/results").json()["rows"])


def test_results_compare_each_motor_with_its_previous_fit(
    alice: Caller, batch: str, runs: list[str]
) -> None:
    """The drift is the difference of medians; a motor without a previous fit has none."""
    rows = rows_of(alice, batch)
    fits = alice.client.show_batch(batch).fits
    results = [alice.fit(fit["fit"]) for fit in fits]
    earlier = [f for f in alice.client.fits(motor="drift 0") if f.id != fits[0]["fit"]]

    assert [(row["motor"], row["status"]) for row in rows] == [
        ("drift 0", "succeeded"), ("drift 1", "succeeded"), ("=drift()", "succeeded"),
        ("drift 3", "failed"),
    ]  # fmt: skip
    medians = [r["result"]["parameters"]["Ra25"]["median"] for r in results[:2]]
    assert [row["Ra25"] for row in rows[:2]] == medians
    assert rows[0]["Ra25_drift"] == pytest.approx(medians[0] - medians[1])
    assert rows[0]["Ra25_drift_significant"] is (abs(rows[0]["Ra25_drift_sds"]) > 3.5)
    assert rows[1]["Ra25_drift"] == 0.0
    assert rows[1]["Ra25_drift_significant"] is False
    assert (rows[0]["previous_shared_runs"], rows[1]["previous_shared_runs"]) == (0, 1)
    assert rows[0]["previous_fit"] == earlier[0].id
    assert rows[2]["Ra25_drift"] is rows[2]["previous_fit"] is None
    assert rows[3]["error"] == "no step made the error smaller"
    assert rows[0]["fit"] == fits[0]["fit"]


def test_previous_fits_come_from_the_same_workspace(bob: Caller, batch: str, alice: Caller) -> None:
    """A motor of the same name in another workspace is another motor."""
    run = str(bob.upload(run_text(702))["id"])
    own = begin(bob, [{"motor": "drift 0", "training": [run]}])
    ended(bob, own)

    assert rows_of(bob, own)[0]["previous_fit"] is None
    for call in ("results", "results.csv", "report"):
        assert bob.http.get(f"/batches/{batch}/{call}").status_code == 404
    assert bob.http.delete(f"/batches/{batch}").status_code == 404
    assert alice.http.get(f"/batches/{batch}").status_code == 200


@pytest.mark.parametrize("form", FORMS)
def test_results_are_the_same_by_accept_and_by_suffix(alice: Caller, batch: str, form: str) -> None:
    """Accept header and URL suffix select the same format and the same rows."""
    by_accept = alice.http.get(f"/batches/{batch}/results", headers={"Accept": FORMS[form]})
    by_suffix = alice.http.get(f"/batches/{batch}/results.{form}")
    rows = rows_of(alice, batch)

    for answer in (by_accept, by_suffix):
        assert answer.headers["content-type"].startswith(FORMS[form])
        if form == "json":
            assert answer.json() == {"id": batch, "status": "partial", "rows": rows}
        elif form == "csv":
            lines = list(csv.DictReader(io.StringIO(answer.text, newline="")))
            assert [line["motor"] for line in lines] == [
                "drift 0", "drift 1", "'=drift()", "drift 3"
            ]  # fmt: skip
            assert [line["Ra25"] for line in lines] == [str(r["Ra25"] or "") for r in rows]
        else:
            assert parquet.read_table(io.BytesIO(answer.content)).to_pylist() == rows


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("text/csv;q=0.5, application/vnd.apache.parquet;q=0.9", FORMS["parquet"]),
        ("text/html, */*;q=0.8", FORMS["json"]),
        ("text/*", FORMS["csv"]),
        ("TEXT/CSV", FORMS["csv"]),
        ("image/png", "application/problem+json"),
        ("text/csv;q=0", "application/problem+json"),
        ("", "application/problem+json"),
        (";;q=x,,", "application/problem+json"),
    ],
)
def test_format_follows_the_weights_of_the_accept_header(
    alice: Caller, batch: str, accept: str, kind: str
) -> None:
    """RFC 9110, 12.5.1: the highest weight is chosen; 406 if no format is acceptable."""
    answer = alice.http.get(f"/batches/{batch}/results", headers={"Accept": accept})

    if accept == "":
        # An empty header accepts every format.
        kind = FORMS["json"]
    assert answer.headers["content-type"].startswith(kind)
    assert answer.status_code == (406 if "problem" in kind else 200)


def test_unknown_format_suffix_is_refused(alice: Caller, batch: str) -> None:
    """An unknown suffix gives 422, as any invalid field does."""
    assert alice.http.get(f"/batches/{batch}/results.xlsx").status_code == 422


def test_fleet_page_has_no_script_and_links_to_the_fits(alice: Caller, batch: str) -> None:
    """The page lists every motor; the name of the batch is escaped."""
    answer = alice.http.get(f"/batches/{batch}/report")
    fits = alice.client.show_batch(batch).fits

    assert answer.headers["content-security-policy"] == FLEET_POLICY
    assert answer.headers["content-type"].startswith("text/html")
    assert "&lt;b&gt;second&lt;/b&gt;" in answer.text
    assert "<script" not in answer.text
    for fit in fits:
        assert f'<a href="/fits/{fit["fit"]}">' in answer.text


def test_client_writes_table_and_page(alice: Caller, batch: str, tmp_path: Any) -> None:
    """The suffix of the path selects the format; an unknown suffix is rejected before a call."""
    for form in FORMS:
        path = alice.client.fetch_table(batch, tmp_path / f"fleet.{form}")
        assert path.stat().st_size > 100
    assert alice.client.fetch_fleet(batch, tmp_path / "fleet.html").stat().st_size > 10_000
    with pytest.raises(ValueError, match=r"'fleet\.xlsx' has no suffix of a table format"):
        alice.client.fetch_table(batch, tmp_path / "fleet.xlsx")


def test_batch_progress_counts_ended_fits(alice: Caller, runs: list[str]) -> None:
    """The fraction of a batch with two fast and two slow fits never decreases."""
    motors: list[dict[str, object]] = [
        {"motor": f"p {n}", "training": [runs[0]], "options": {"seed": SLOW if n > 1 else 0}}
        for n in range(4)
    ]
    made = begin(alice, motors)
    seen = []
    while (now := alice.http.get(f"/batches/{made}").json())["status"] in ("queued", "running"):
        seen.append(now["progress"])
        time.sleep(0.1)

    shares = [progress["fraction"] for progress in seen]
    assert shares == sorted(shares)
    assert any(0.0 < share < 1.0 for share in shares)
    assert {progress["total"] for progress in seen} == {4}
    assert now["progress"] == {"fraction": 1.0, "ended": 4, "total": 4}
    listed = alice.http.get("/batches").json()["items"][0]
    assert (listed["id"], listed["progress"]) == (made, now["progress"])


def test_deleting_a_batch_cancels_it_and_then_removes_it(alice: Caller, runs: list[str]) -> None:
    """The first DELETE cancels the unfinished fits; the second removes the batch with all fits."""
    motors: list[dict[str, object]] = [
        {"motor": f"c {n}", "training": [runs[0]], "options": {"seed": SLOW if n else QUICK}}
        for n in range(4)
    ]
    made = begin(alice, motors)
    first = alice.client.show_batch(made).fits[0]["fit"]
    alice.wait(first)

    cancelled = alice.http.delete(f"/batches/{made}")
    rows = rows_of(alice, made)
    removed = alice.http.delete(f"/batches/{made}")

    assert cancelled.status_code == 200
    assert cancelled.json()["counts"] == {"succeeded": 1, "cancelled": 3}
    assert cancelled.json()["status"] == "partial"
    assert [row["status"] for row in rows] == ["succeeded"] + ["cancelled"] * 3
    assert removed.status_code == 204
    assert alice.http.get(f"/batches/{made}").status_code == 404
    assert alice.http.get(f"/fits/{first}").status_code == 404


def test_unfinished_fits_are_rows_without_numbers(alice: Caller, runs: list[str]) -> None:
    """The table of an unfinished batch has the motor, the state and the fit ID only."""
    run = str(alice.upload(run_text(703))["id"])
    made = begin(alice, [{"motor": "w", "training": [run], "options": {"seed": SLOW}}])

    (row,) = rows_of(alice, made)

    assert row["status"] in ("queued", "running")
    assert {n for n, v in row.items() if v not in (None, "")} == {"motor", "status", "fit"}
    alice.client.delete_batch(made)


def test_result_rows_are_strict_json(alice: Caller, batch: str) -> None:
    """The document contains neither NaN nor infinity."""
    text = alice.http.get(f"/batches/{batch}/results.json").text

    def refuse(name: str) -> None:
        raise AssertionError(name)

    json.loads(text, parse_constant=refuse)

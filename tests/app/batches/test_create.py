"""Creation of batches: accepted or rejected as a whole, in a short transaction."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from app.access.quotas import Quotas
from app.access.service import Caller
from app.batches import MOST_RUNS
from app.batches.service import BatchService
from app.database import Database
from app.errors import FieldRefused, KeyReused, NotFound, WaitingQuota
from app.fits import repository
from app.fits.request import FitRequest
from app.fits.supervisor import Supervisor
from app.identifiers import new_id
from app.storage import Storage
from app.tables import RunRow
from tests.app.rows import keep_runs
from tests.app.statements import statements

ALICE = Caller("alice")


class Sleeper:
    """Supervisor that starts no fit."""

    def wake(self) -> None:
        """Ignore the new fit."""


@pytest.fixture
def batches(database: Database, tmp_path: Path) -> BatchService:
    """Batch service with a quota of a thousand waiting fits."""
    storage = Storage(tmp_path / "data", "bench")
    return BatchService(database, storage, cast("Supervisor", Sleeper()), Quotas(0, 0, 1000))


def motors(run_ids: Sequence[str], number: int) -> list[FitRequest]:
    """Requests of motors that divide the runs among them; the last run of each is validation."""
    most = len(run_ids) // number
    dealt = [run_ids[first * most : (first + 1) * most] for first in range(number)]
    options = {"controllers": ["P:1"]}
    return [FitRequest(ids[:-1], ids[-1:], options, f"m{n}") for n, ids in enumerate(dealt)]


def test_motors_of_one_type_are_grouped_in_the_table(
    database: Database, batches: BatchService
) -> None:
    """The type of the request stands in the batch and in each row of its table."""
    requests = motors(keep_runs(database, "alice", 9), 3)
    typed = [
        replace(request, motor_type=kind)
        for request, kind in zip(requests, ("RE40", " RE40 ", None), strict=True)
    ]

    made = batches.create(ALICE, typed, None, None)

    _, rows = batches.rows(ALICE, made.row.id)
    assert [fit.motor_type for fit in made.fits] == ["RE40", "RE40", None]
    assert [row["type"] for row in rows] == ["RE40", "RE40", None]


@pytest.mark.parametrize("number", [2, 200])
def test_statements_of_a_batch_do_not_grow_with_its_motors(
    database: Database, batches: BatchService, number: int
) -> None:
    """A batch of 200 motors with 10,000 runs needs fewer than 40 SQL statements."""
    requests = motors(keep_runs(database, "alice", 50 * number), number)

    with statements(database, written=True) as seen:
        made = batches.create(ALICE, requests, None, None)

    assert len(seen) < 40
    assert made.counts == {"queued": number}


def test_fits_of_a_batch_keep_their_order_and_runs(
    database: Database, batches: BatchService
) -> None:
    """The stored fits have the motors and runs of the request, in its order."""
    requests = motors(keep_runs(database, "alice", 40), 8)

    made = batches.create(ALICE, requests, "fleet", None)

    with database.reading() as session:
        kept = repository.run_ids(session, [fit.id for fit in made.fits])
    assert [fit.motor for fit in made.fits] == [request.motor for request in requests]
    assert [kept[fit.id] for fit in made.fits] == [
        {"training": list(request.training), "validation": list(request.validation)}
        for request in requests
    ]


@pytest.mark.parametrize("missing", ["foreign", "unknown", "no id"])
def test_missing_run_is_named_with_its_motor_and_nothing_is_stored(
    database: Database, batches: BatchService, missing: str
) -> None:
    """One run of the last of four motors is not in the workspace."""
    requests = motors(keep_runs(database, "alice", 40), 4)
    run = {
        "foreign": keep_runs(database, "bob", 1)[0],
        "unknown": new_id("run"),
        "no id": "run 7",
    }[missing]
    requests[3] = FitRequest([run], [], {"controllers": ["P:1"]}, "pump")

    with pytest.raises(NotFound, match=rf"motors\.3 \(pump\): there is no run '{run}'"):
        batches.create(ALICE, requests, None, None)
    assert batches.page(ALICE, after=None, limit=10) == ([], None)


def test_run_deleted_during_the_creation_is_missing(
    database: Database, batches: BatchService
) -> None:
    """The batch waits for the lock of the concurrent deletion and then sees its effect."""
    ids = keep_runs(database, "alice", 4)

    with ThreadPoolExecutor(1) as pool:
        with database.writing() as session:
            session.delete(session.get_one(RunRow, ids[3]))
            session.flush()
            asked = pool.submit(batches.create, ALICE, motors(ids, 2), None, None)
            time.sleep(0.3)
        with pytest.raises(NotFound, match=ids[3]):
            asked.result(timeout=30)
    assert batches.page(ALICE, after=None, limit=10) == ([], None)


def test_limit_of_runs_is_checked_before_any_query(
    database: Database, batches: BatchService
) -> None:
    """A batch at the limit passes this check and fails at its missing runs."""
    ids = [f"run{number}" for number in range(MOST_RUNS)]
    requests = motors(ids, 100)

    with pytest.raises(NotFound, match="run0"):
        batches.create(ALICE, requests, None, None)
    with statements(database, written=True) as seen:
        message = rf"{MOST_RUNS + 1} runs; .* {MOST_RUNS} in one batch.* as several batches"
        with pytest.raises(FieldRefused, match=message):
            batches.create(ALICE, [*requests, FitRequest(["one more"], [], {})], None, None)
    assert seen == []


def test_concurrent_requests_with_one_key_are_one_batch(
    database: Database, batches: BatchService
) -> None:
    """Another request with the same Idempotency-Key is rejected."""
    requests = motors(keep_runs(database, "alice", 40), 4)

    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(batches.create, ALICE, requests, None, "key") for _ in range(4)]
        made = {future.result(timeout=60).row.id for future in asked}

    assert len(made) == 1
    with pytest.raises(KeyReused, match="use a new key"):
        batches.create(ALICE, requests[:3], None, "key")


def test_batch_beyond_the_quota_stores_nothing(database: Database, batches: BatchService) -> None:
    """With 600 of 1000 fits waiting, a batch of 401 is rejected."""
    ids = keep_runs(database, "alice", 1202)
    batches.create(ALICE, motors(ids[:1200], 600), None, None)

    with pytest.raises(WaitingQuota, match="600 fits .* wait and 401 more"):
        batches.create(ALICE, motors(ids[:802], 401), None, None)
    assert len(batches.page(ALICE, after=None, limit=10)[0]) == 1

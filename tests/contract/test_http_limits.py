"""Rate limits and quotas over HTTP: status, code and retry time."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.app.pretended import FAMILY, SLOW
from tests.app.service import Caller, Server, make_key, run_text, serving

BURST = 30


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Server with small limits: 10 calls/s, 3 runs, 20,000 bytes, 2 waiting fits, 3 streams."""
    data_dir = tmp_path_factory.mktemp("limited") / "data"
    make_key(data_dir)
    with serving(
        data_dir,
        RATE_PER_S=10,
        RATE_BURST=BURST,
        QUOTA_RUNS=3,
        QUOTA_BYTES=20_000,
        QUOTA_WAITING_FITS=2,
        STREAMS_PER_KEY=3,
        WORKERS=1,
    ) as running:
        yield running


def test_rate_limit_answers_429_with_a_retry_time(limited: Server) -> None:
    """With a burst of 30 and 10 calls/s, the last of 60 consecutive calls are rejected."""
    with Caller(limited, make_key(limited.data_dir, "hasty")) as caller:
        answers = [caller.http.get("/runs?limit=1") for _ in range(2 * BURST)]
        refused = [answer for answer in answers if answer.status_code == 429]
        assert {answer.status_code for answer in answers} == {200, 429}
        first = answers[0]
        assert re.fullmatch(r'"key";r=29;t=1', first.headers["ratelimit"])
        assert first.headers["ratelimit-policy"] == f'"key";q={BURST};w=3'
        problem = refused[0].json()
        assert (problem["code"], problem["status"]) == ("rate_limited", 429)
        assert refused[0].headers["content-type"] == "application/problem+json"
        assert refused[0].headers["x-content-type-options"] == "nosniff"
        assert int(refused[0].headers["retry-after"]) == 1

        time.sleep(int(refused[-1].headers["retry-after"]))
        assert caller.http.get("/runs?limit=1").status_code == 200


def test_rate_limit_is_per_key_and_exempts_health(limited: Server) -> None:
    """While one key is limited, another key and health are answered."""
    with (
        Caller(limited, make_key(limited.data_dir, "busy")) as busy,
        Caller(limited, make_key(limited.data_dir, "calm")) as calm,
        Caller(limited) as probe,
    ):
        while busy.http.get("/runs?limit=1").status_code == 200:
            pass
        assert calm.http.get("/runs?limit=1").status_code == 200
        health = [probe.http.get("/healthz") for _ in range(3 * BURST)]
        assert {answer.status_code for answer in health} == {200}
        assert not [answer for answer in health if "ratelimit" in answer.headers]
        text = probe.http.get("/metrics").text
        assert re.search(r'motorid_refused_total\{limit="rate"\} [1-9]', text)


def test_number_of_event_streams_per_key_is_limited(limited: Server) -> None:
    """The fourth stream returns 429 until one of the three others is closed."""
    with Caller(limited, make_key(limited.data_dir, "curious")) as caller, ExitStack() as streams:
        fit = caller.begin(caller.upload(run_text(60))["id"], seed=FAMILY)["id"]
        address = f"/fits/{fit}/events"
        for _ in range(3):
            assert streams.enter_context(caller.http.stream("GET", address)).status_code == 200
        refused = caller.http.get(address)
        text = caller.http.get(f"{limited.url}/metrics").text
        streams.close()
        deadline = time.monotonic() + 10
        status = 429
        while status == 429 and time.monotonic() < deadline:
            time.sleep(0.1)
            with caller.http.stream("GET", address) as again:
                status = again.status_code
        caller.http.delete(f"/fits/{fit}")

    problem = refused.json()
    assert (refused.status_code, problem["code"]) == (429, "too_many_streams")
    assert refused.headers["content-type"] == "application/problem+json"
    assert int(refused.headers["retry-after"]) > 0
    assert "MOTORID_STREAMS_PER_KEY" in problem["detail"]
    assert 'motorid_refused_total{limit="too_many_streams"} 1.0' in text
    assert status == 200


def test_quota_of_runs_rejects_a_new_run(limited: Server) -> None:
    """A repeated upload of a stored run is still accepted."""
    with Caller(limited, make_key(limited.data_dir, "full")) as caller:
        runs = [caller.upload(run_text(seed))["id"] for seed in range(3)]
        fourth = caller.http.post("/runs", files={"file": ("a.csv", run_text(3))})
        again = caller.http.post("/runs", files={"file": ("a.csv", run_text(0))})
        caller.http.delete(f"/runs/{runs[1]}")
        after = caller.http.post("/runs", files={"file": ("a.csv", run_text(3))})

    assert (fourth.status_code, fourth.json()["code"]) == (403, "quota_runs")
    assert (again.status_code, again.json()["id"]) == (200, runs[0])
    assert after.status_code == 201
    assert [path for path in limited.data_dir.rglob("incoming/*/*")] == []


def test_quota_of_bytes_rejects_a_new_run(limited: Server) -> None:
    """Of two files with 15,000 to 20,000 bytes each, only one fits."""
    with Caller(limited, make_key(limited.data_dir, "large")) as caller:
        files = [run_text(seed, rows=350) for seed in range(2)]
        assert 15_000 < len(files[0]) < 20_000
        caller.upload(files[0])
        second = caller.http.post("/runs", files={"file": ("a.csv", files[1])})

    assert (second.status_code, second.json()["code"]) == (507, "quota_bytes")
    assert "MOTORID_QUOTA_BYTES" in second.json()["detail"]


def test_quota_of_waiting_fits_rejects_fits_and_batches(limited: Server) -> None:
    """With two waiting fits, another fit or batch returns 429 with a retry time."""
    with Caller(limited, make_key(limited.data_dir, "queue")) as caller:
        run = caller.upload(run_text(50))["id"]
        running = caller.begin(run, seed=SLOW)["id"]
        caller.wait(running, "running")
        waiting = [caller.begin(run, seed=SLOW)["id"] for _ in range(2)]
        fit = caller.http.post("/fits", json={"training": [run]})
        batch = caller.http.post("/batches", json={"motors": [{"training": [run]}]})
        for fit_id in (running, *waiting):
            caller.http.delete(f"/fits/{fit_id}")
        after = caller.http.post("/fits", json={"training": [run]})

    for answer in (fit, batch):
        assert (answer.status_code, answer.json()["code"]) == (429, "quota_waiting_fits")
        assert int(answer.headers["retry-after"]) > 0
    assert after.status_code == 202


def test_full_upload_queue_answers_429_with_a_retry_time(data_dir: Path) -> None:
    """Of sixteen parallel uploads to one reader, each returns 201 or 429 and leaves no file."""
    key = make_key(data_dir)
    with (
        serving(data_dir, READERS=1, WAITING_UPLOADS=0) as server,
        Caller(server, key) as caller,
        ThreadPoolExecutor(16) as pool,
    ):
        answers = list(
            pool.map(
                lambda text: caller.http.post("/runs", files={"file": ("a.csv", text)}),
                [run_text(seed, rows=5000) for seed in range(16)],
            )
        )
        refused = [answer for answer in answers if answer.status_code != 201]

        assert 0 < len(refused) < 16
        for answer in refused:
            assert answer.status_code == 429
            assert answer.json()["code"] == "too_many_uploads"
            assert 1 <= int(answer.headers["retry-after"]) <= 60
        assert len(list((data_dir / "runs").iterdir())) == 16 - len(refused)
        assert [path for path in data_dir.rglob("incoming/*/*")] == []

"""Fits over HTTP: submit, follow, cancel and fetch."""

from __future__ import annotations

import json
import time
import uuid
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.app.pretended import (
    BAD_INPUT,
    FAMILY,
    HELD,
    KILLED,
    NO_SOLUTION,
    ONCE_KILLED,
    QUICK,
    SLOW,
)
from tests.app.service import Caller, Server, empty, run_text


def alive(pid: int) -> bool:
    """Return True if a process runs; a zombie does not."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_fit_is_accepted_computed_and_fetched(alice: Caller) -> None:
    """The result lists the requested runs with role and order, and the options."""
    runs = [alice.upload(run_text(seed), f"{seed}.csv") for seed in (30, 31, 32)]
    body = {
        "training": [runs[1]["id"], runs[0]["id"]],
        "validation": [runs[2]["id"]],
        "options": {"temperatures": [10.0, 90.0], "bench": "bench 4"},
        "motor": "motor 5",
    }

    accepted = alice.http.post("/fits", json=body)
    fit = alice.wait(accepted.json()["id"])

    assert accepted.status_code == 202
    assert accepted.headers["location"] == f"/api/v1/fits/{fit['id']}"
    assert accepted.json()["status"] == "queued"
    assert accepted.json()["result"] is None
    ended = {"stage": "done", "fraction": 1.0, "remaining_s": None}
    assert (fit["status"], fit["progress"]) == ("succeeded", ended)
    assert (fit["training"], fit["validation"]) == (body["training"], body["validation"])
    assert fit["result"]["runs"] == [
        {"file": "31.csv", "sha256": runs[1]["sha256"], "role": "training"},
        {"file": "30.csv", "sha256": runs[0]["sha256"], "role": "training"},
        {"file": "32.csv", "sha256": runs[2]["sha256"], "role": "validation"},
    ]
    assert fit["result"]["temperatures"] == [10.0, 90.0]
    assert fit["result"]["label"] == {"motor": "motor 5", "bench": "bench 4"}
    report = alice.http.get(f"/fits/{fit['id']}/report")
    assert report.headers["content-type"] == "text/html; charset=utf-8"
    assert "sandbox allow-scripts" in report.headers["content-security-policy"]
    assert "allow-same-origin" not in report.headers["content-security-policy"]
    posterior = alice.http.get(f"/fits/{fit['id']}/posterior")
    assert posterior.headers["content-type"] == "application/x-netcdf"
    assert posterior.content.startswith(b"CDF")


def test_mapping_of_a_run_goes_with_it_into_the_fit(alice: Caller) -> None:
    """A speed declared in rpm reaches the fit multiplied by 2 pi / 60."""
    plain = alice.upload(run_text(33))
    mapping = {"speed_rad_s": {"column": "speed_rad_s", "unit": "rpm"}}
    mapped = alice.upload(run_text(33), mapping=json.dumps(mapping))

    fit = alice.wait(alice.begin(plain["id"], mapped["id"])["id"])

    in_rad_s, from_rpm = fit["result"]["speeds"]
    assert from_rpm == pytest.approx(in_rad_s * 2 * 3.141592653589793 / 60)


def test_fit_without_posterior_has_none_to_fetch(alice: Caller, stored: str) -> None:
    """The call returns 404 with the reason, and the fit has no link to a posterior."""
    fit = alice.wait(alice.begin(stored, posterior=False)["id"])

    answer = alice.http.get(f"/fits/{fit['id']}/posterior")

    assert answer.status_code == 404
    assert answer.json()["code"] == "not_ready"
    assert "has no posterior" in answer.json()["detail"]
    assert "posterior" not in fit["links"]


def test_outputs_are_not_found_before_the_end(alice: Caller, stored: str) -> None:
    """The calls return 404 `not_ready` while the fit runs."""
    fit = alice.begin(stored, seed=SLOW)["id"]

    answers = [alice.http.get(f"/fits/{fit}/{output}") for output in ("report", "posterior")]
    alice.http.delete(f"/fits/{fit}")

    assert [answer.status_code for answer in answers] == [404, 404]
    assert {answer.json()["code"] for answer in answers} == {"not_ready"}


@pytest.mark.parametrize(
    ("seed", "attempt", "error"),
    [
        (BAD_INPUT, 1, {"code": "input", "row": 7, "column": "speed_rad_s", "file": "run.csv"}),
        (NO_SOLUTION, 1, {"code": "computation", "detail": "no step made the error smaller"}),
        (KILLED, 3, {"code": "crashed"}),
    ],
)
def test_failed_fit_reports_the_reason(
    alice: Caller, stored: str, seed: int, attempt: int, error: dict[str, object]
) -> None:
    """An input or computation error fails at once, a crash after three attempts."""
    fit = alice.wait(alice.begin(stored, seed=seed)["id"])

    assert (fit["status"], fit["attempt"], fit["result"]) == ("failed", attempt, None)
    assert error.items() <= {k: v for k, v in fit["error"].items() if v is not None}.items()
    assert fit["error"]["detail"]


def test_fit_that_crashed_once_succeeds_with_its_second_attempt(
    alice: Caller, stored: str, server: Server
) -> None:
    """The files of the first attempt are removed."""
    fit = alice.wait(alice.begin(stored, seed=ONCE_KILLED)["id"])

    assert (fit["status"], fit["attempt"]) == ("succeeded", 2)
    assert [p.name for p in (server.data_dir / "fits" / fit["id"]).iterdir()] == ["2"]


def test_cancelling_kills_the_process_and_its_child_within_a_second(
    alice: Caller, stored: str, server: Server
) -> None:
    """The mock fit writes the IDs of its process and of its child to a file.

    The second is measured as a hundred pauses of 10 ms, concurrently with the call: a busy
    machine that delays the service delays the pauses as well.
    """
    fit = alice.begin(stored, seed=FAMILY)["id"]
    pids = server.data_dir / "fits" / fit / "1" / "pids"
    deadline = time.monotonic() + 20
    while not (pids.exists() and len(pids.read_text().split()) == 2):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    processes = [int(pid) for pid in pids.read_text().split()]
    assert all(alive(pid) for pid in processes)

    with ThreadPoolExecutor(1) as beside:
        waited = beside.submit(waits_for_the_end_of, processes)
        answer = alice.http.delete(f"/fits/{fit}")

    assert waited.result() < 100
    assert answer.status_code == 200
    assert answer.json()["status"] == "cancelled"
    assert alice.fit(fit)["status"] == "cancelled"


def waits_for_the_end_of(processes: list[int]) -> int:
    """Number of pauses of 10 ms until all processes have ended."""
    for waits in range(1000):
        if not any(alive(pid) for pid in processes):
            return waits
        time.sleep(0.01)
    return 1000


def test_deleting_twice_cancels_and_then_removes(
    alice: Caller, stored: str, server: Server
) -> None:
    """Three DELETE calls return 200, 204 and 404; no file of the fit remains."""
    fit = alice.begin(stored, seed=SLOW)["id"]

    statuses = [alice.http.delete(f"/fits/{fit}").status_code for _ in range(3)]

    assert statuses == [200, 204, 404]
    deadline = time.monotonic() + 5
    while (server.data_dir / "fits" / fit).exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not list((server.data_dir / "fits").glob(f"{fit}/*"))


def test_removing_a_fit_removes_its_outputs(alice: Caller, stored: str, server: Server) -> None:
    """Fit and report give 404 afterwards, and the directory is gone."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]

    assert alice.http.delete(f"/fits/{fit}").status_code == 204
    assert alice.http.get(f"/fits/{fit}").status_code == 404
    assert alice.http.get(f"/fits/{fit}/report").status_code == 404
    assert not (server.data_dir / "fits" / fit).exists()


def test_same_idempotency_key_is_the_same_fit(alice: Caller, stored: str) -> None:
    """Three requests, with the fields in different order, create one fit."""
    key = {"Idempotency-Key": str(uuid.uuid4())}
    body = {"training": [stored], "options": {"seed": QUICK, "posterior": False}}
    turned = {"options": {"posterior": False, "seed": QUICK}, "training": [stored]}

    answers = [alice.http.post("/fits", json=b, headers=key) for b in (body, turned, body)]

    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_idempotency_key_with_another_request_is_refused(alice: Caller, stored: str) -> None:
    """The second request returns 422 with the code `idempotency_key_reused`."""
    key = {"Idempotency-Key": str(uuid.uuid4())}
    first = alice.http.post("/fits", json={"training": [stored]}, headers=key)

    other = {"training": [stored], "options": {"posterior": False}}
    second = alice.http.post("/fits", json=other, headers=key)

    assert (first.status_code, second.status_code) == (202, 422)
    assert second.json()["code"] == "idempotency_key_reused"


def test_idempotency_key_belongs_to_a_workspace(alice: Caller, bob: Caller, stored: str) -> None:
    """The same key in another workspace creates another fit."""
    key = {"Idempotency-Key": str(uuid.uuid4())}
    run = bob.upload(run_text(34))["id"]

    ours = alice.http.post("/fits", json={"training": [stored]}, headers=key)
    theirs = bob.http.post("/fits", json={"training": [run]}, headers=key)

    assert (ours.status_code, theirs.status_code) == (202, 202)
    assert ours.json()["id"] != theirs.json()["id"]


def test_fit_without_a_motor_is_for_the_one_of_all_its_runs(alice: Caller) -> None:
    """Runs of two motors, or one without, leave it open; a given name counts."""
    own, other = f"motor {uuid.uuid4()}", f"motor {uuid.uuid4()}"
    first, second, third, nameless = (
        alice.upload(run_text(seed), f"{seed}.csv", **fields)["id"]
        for seed, fields in enumerate(({"motor": own}, {"motor": own}, {"motor": other}, {}), 60)
    )

    def named(**body: object) -> object:
        return alice.http.post("/fits", json=body).json()["motor"]

    assert named(training=[first], validation=[second]) == own
    assert named(training=[first, third]) is None
    assert named(training=[first], validation=[nameless]) is None
    assert named(training=[first, second], motor=other) == other


def test_fits_are_listed_by_state_and_motor(alice: Caller, stored: str) -> None:
    """Both filters apply, and the entries contain no result."""
    motor = f"motor {uuid.uuid4()}"
    body = {"training": [stored], "motor": motor}
    fit = alice.wait(alice.http.post("/fits", json=body).json()["id"])

    found = alice.http.get("/fits", params={"motor": motor, "status": "succeeded"}).json()
    none = alice.http.get("/fits", params={"motor": motor, "status": "failed"}).json()

    assert [entry["id"] for entry in found["items"]] == [fit["id"]]
    assert "result" not in found["items"][0]
    assert none == {"items": [], "next": None}


def test_as_many_fits_run_at_once_as_there_are_workers(open_server: Server) -> None:
    """With two workers and four fits without an end, two run at a time."""
    empty(open_server)
    with Caller(open_server) as caller:
        run = caller.upload(run_text(1))["id"]
        fits = [caller.begin(run, seed=HELD)["id"] for _ in range(4)]
        deadline = time.monotonic() + 60
        most = 0
        while time.monotonic() < deadline and most < 2:
            states = [caller.fit(fit)["status"] for fit in fits]
            most = max(most, states.count("running"))
            assert states.count("running") <= 2
        for fit in fits:
            caller.http.delete(f"/fits/{fit}")

    assert most == 2


def test_failed_fit_does_not_affect_the_rest_of_its_batch(alice: Caller, stored: str) -> None:
    """With one failed fit of three, the batch is partial and two results are available."""
    motors = [
        {"motor": "a", "training": [stored]},
        {"motor": "b", "training": [stored], "options": {"seed": NO_SOLUTION}},
        {"motor": "c", "training": [stored]},
    ]
    body = {"name": "refit", "motors": motors, "options": {"posterior": False}}
    key = {"Idempotency-Key": str(uuid.uuid4())}

    accepted = alice.http.post("/batches", json=body, headers=key)
    again = alice.http.post("/batches", json=body, headers=key)
    address = accepted.headers["location"].removeprefix("/api/v1")
    deadline = time.monotonic() + 30
    while (batch := alice.http.get(address).json())["status"] in ("queued", "running"):
        assert time.monotonic() < deadline
        time.sleep(0.05)

    assert accepted.status_code == 202
    assert again.json()["id"] == accepted.json()["id"]
    assert batch["status"] == "partial"
    assert batch["counts"] == {"succeeded": 2, "failed": 1}
    assert [(fit["motor"], fit["status"]) for fit in batch["fits"]] == [
        ("a", "succeeded"),
        ("b", "failed"),
        ("c", "succeeded"),
    ]
    assert batch["fits"][1]["error"]["code"] == "computation"
    first = alice.fit(batch["fits"][0]["fit"])
    assert (first["batch"], first["options"]["posterior"]) == (batch["id"], False)
    assert batch["id"] in [b["id"] for b in alice.http.get("/batches").json()["items"]]


def test_batch_with_one_unknown_run_is_refused_whole(alice: Caller, stored: str) -> None:
    """The request returns 404 and creates no fit for the other motor."""
    motor = f"motor {uuid.uuid4()}"
    motors = [{"motor": motor, "training": [stored]}, {"training": ["run_" + "a" * 26]}]

    answer = alice.http.post("/batches", json={"motors": motors})

    assert answer.status_code == 404
    assert alice.http.get("/fits", params={"motor": motor}).json()["items"] == []

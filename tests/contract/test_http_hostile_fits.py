"""Malformed requests for fits and batches: each has a defined error, none a 500."""

from __future__ import annotations

import json

import pytest

from tests.app.service import Caller, run_text
from tests.contract.hostile import JSON, UNKNOWN, assert_is_problem

DEEP = "[" * 50_000 + "]" * 50_000
BODIES = {
    "nothing": (b"", 422),
    "no json": (b"{training: [1]}", 400),
    "half json": (b'{"training": ["', 400),
    "no utf-8": (b'{"training": ["\xff\xfe"]}', 400),
    "deep": (DEEP.encode(), 400),
    "a list": (b"[]", 422),
    "a number": (b"1", 422),
    "null": (b"null", 422),
    "no training": (b"{}", 422),
    "empty training": (b'{"training": []}', 422),
    "training is text": (f'{{"training": "{UNKNOWN}"}}'.encode(), 422),
    "training of numbers": (b'{"training": [1, 2]}', 422),
    "training of lists": (b'{"training": [["a"]]}', 422),
    "unknown run": (f'{{"training": ["{UNKNOWN}"]}}'.encode(), 404),
    "no id": (b'{"training": ["../../etc/passwd"]}', 404),
    "NUL in an id": (b'{"training": ["run_\\u0000"]}', 422),
    "half a surrogate": (b'{"training": ["\\ud800"]}', 422),
    "an endless id": (json.dumps({"training": ["x" * 5000]}).encode(), 422),
    "too many runs": (json.dumps({"training": [UNKNOWN] * 201}).encode(), 422),
    "a field too much": (f'{{"training": ["{UNKNOWN}"], "x": 1}}'.encode(), 422),
    "an endless number": (b'{"training": [' + b"9" * 10_000 + b"]}", 400),
}


@pytest.mark.parametrize(("body", "status"), BODIES.values(), ids=BODIES.keys())
def test_malformed_fit_request_is_refused(alice: Caller, body: bytes, status: int) -> None:
    """Invalid JSON gives 400, an invalid field 422, an unknown run 404."""
    assert_is_problem(alice.http.post("/fits", content=body, headers=JSON), status)


OPTIONS = [
    {"seed": -1},
    {"seed": 2**32},
    {"seed": 10**400},
    {"seed": "0"},
    {"seed": 1.5},
    {"seed": True},
    {"posterior": "yes"},
    {"posterior": 1},
    {"hold": "spline"},
    {"hold": None},
    {"temperatures": []},
    {"temperatures": [25.0] * 21},
    {"temperatures": ["warm"]},
    {"temperatures": [-400.0]},
    {"temperatures": [1e308]},
    {"controllers": []},
    {"controllers": ["X:1"]},
    {"controllers": ["P:"]},
    {"controllers": ["P:nan"]},
    {"controllers": ["PID:1"]},
    {"controllers": ["P:" + "1" * 200]},
    {"controllers": "P:1"},
    {"known": "L=1e-3"},
    {"known": [1]},
    {"known": ["Kt=1"]},
    {"known": ["L=1e-3+--5%"]},
    {"known": ["L=1e-3", "L=2e-3"]},
    {"known": ["L=" + "1" * 200]},
    {"known": ["J=1e-4"] * 8},
    {"nameplate": 12},
    {"nameplate": None},
    {"nameplate": "voltage=12"},
    {"nameplate": "volts=12"},
    {"nameplate": "voltage=12," * 100},
    {"Seed": 1},
    {"pipeline": "os:system"},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: str(options)[:40])
def test_invalid_option_is_named(alice: Caller, stored: str, options: dict[str, object]) -> None:
    """The response is 422 and contains the name of the option."""
    body = json.dumps({"training": [stored], "options": options})

    answer = alice.http.post("/fits", content=body, headers=JSON)

    assert_is_problem(answer, 422, 400)
    if answer.status_code == 422:
        assert next(iter(options)).rstrip("s") in answer.text


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_number_that_is_not_finite_is_refused(alice: Caller, stored: str, number: str) -> None:
    """Python's JSON parser accepts such numbers, so the service must reject them."""
    body = f'{{"training": ["{stored}"], "options": {{"temperatures": [{number}]}}}}'

    assert_is_problem(alice.http.post("/fits", content=body, headers=JSON), 422, 400)


def test_run_in_two_roles_is_refused(alice: Caller, stored: str) -> None:
    """A validation run must not be a training run, and no run may be listed twice."""
    for body in ({"training": [stored, stored]}, {"training": [stored], "validation": [stored]}):
        answer = alice.http.post("/fits", json=body)

        assert_is_problem(answer, 422)
        assert "twice" in answer.json()["detail"]


def test_validation_on_the_bytes_of_a_training_run_is_refused(alice: Caller, stored: str) -> None:
    """The same bytes with another mapping are rejected, too; a batch is rejected as a whole."""
    mapping = json.dumps({"speed_rad_s": {"column": "speed_rad_s", "scale": 1.0}})
    same = alice.upload(run_text(0), mapping=mapping)["id"]
    assert same != stored
    fit = {"training": [stored], "validation": [same]}
    for path, body in (("/fits", fit), ("/batches", {"motors": [{"training": [stored]}, fit]})):
        answer = alice.http.post(path, json=body)

        assert_is_problem(answer, 422)
        detail = answer.json()["detail"]
        assert f"run.csv ({same}) has the same bytes as run.csv ({stored}) in training" in detail


@pytest.mark.parametrize("key", ["", "a b", "x" * 256, "naïve", "tab\there"])
def test_invalid_idempotency_key_is_refused(alice: Caller, stored: str, key: str) -> None:
    """A valid key has 1 to 255 visible ASCII characters."""
    headers = {"Idempotency-Key": key.encode("latin-1")}

    answer = alice.http.post("/fits", json={"training": [stored]}, headers=headers)  # type: ignore[arg-type]

    assert_is_problem(answer, 422)
    assert "Idempotency-Key" in answer.json()["detail"]


@pytest.mark.parametrize("path", ["/fits", "/batches"])
@pytest.mark.parametrize(
    "kind", [None, "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"]
)
def test_body_of_another_type_is_refused(
    alice: Caller, stored: str, path: str, kind: str | None
) -> None:
    """A page of another site can send these types without a preflight, but not JSON."""
    headers = {} if kind is None else {"Content-Type": kind}
    body = json.dumps({"training": [stored]}).encode()

    assert_is_problem(alice.http.post(path, content=body, headers=headers), 415)


def test_json_above_the_limit_is_refused_however_it_is_sent(alice: Caller) -> None:
    """A body above the limit gives 413, with Content-Length and in chunks."""
    body = b'{"training": ["' + b"x" * 200_000 + b'"]}'

    announced = alice.http.post("/fits", content=body, headers=JSON)
    in_chunks = alice.http.post("/fits", content=iter([body[:1000], body[1000:]]), headers=JSON)

    assert_is_problem(announced, 413)
    assert_is_problem(in_chunks, 413)


def test_batch_of_no_motor_and_of_too_many_is_refused(alice: Caller, stored: str) -> None:
    """A batch has 1 to 1000 motors."""
    assert_is_problem(alice.http.post("/batches", json={"motors": []}), 422)
    many = {"motors": [{"training": ["r"]}] * 1001}
    assert_is_problem(alice.http.post("/batches", json=many), 422)

"""Output files over HTTP: complete or not found, byte ranges, and file names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import httpx
import pytest

from tests.app.service import Caller, Server, run_text
from tests.contract.hostile import assert_is_problem

REPORT = "<!doctype html><title>Report</title><p>x</html>"
IS_WHOLE: dict[str, Callable[[httpx.Response], bool]] = {
    "": lambda answer: (
        answer.json()["result"]["schema_version"] == 1
        and answer.json()["training"] != []
        and "posterior" in answer.json()["links"]
    ),
    "/report": lambda answer: answer.text == REPORT,
    "/posterior": lambda answer: answer.content == b"CDF\x02 pretended",
}


@pytest.fixture(scope="module")
def fit(alice: Caller, stored: str) -> str:
    """ID of a succeeded fit."""
    return str(alice.wait(alice.begin(stored)["id"])["id"])


def asked(server: Server, key: str, address: str, is_over: Event) -> Iterator[httpx.Response | str]:
    """Responses to a repeated call, or the text of a transport error."""
    with httpx.Client(base_url=server.url, headers={"Authorization": key}) as caller:
        while not is_over.is_set():
            try:
                yield caller.get(f"/api/v1{address}")
            except httpx.TransportError as error:
                yield repr(error)


def test_output_of_a_deleted_fit_is_complete_or_not_found(
    alice: Caller, server: Server, stored: str
) -> None:
    """Six clients read each of twelve fits while it is deleted."""
    key = alice.http.headers["authorization"]
    fits = [alice.begin(stored, seed=0)["id"] for _ in range(12)]
    wrong: list[str] = []
    found = []

    def hammer(fit: str, part: str, is_over: Event) -> None:
        for answer in asked(server, key, f"/fits/{fit}{part}", is_over):
            if isinstance(answer, str):
                wrong.append(answer)
                return
            found.append(answer.status_code)
            if answer.status_code == 404 and answer.json()["code"] == "not_found":
                return
            if answer.status_code != 200 or not IS_WHOLE[part](answer):
                wrong.append(f"{part}: {answer.status_code} {answer.text[:200]}")
                return

    for fit in fits:
        alice.wait(fit)
        is_over = Event()
        with ThreadPoolExecutor(6) as callers:
            for part in (*IS_WHOLE, *IS_WHOLE):
                callers.submit(hammer, fit, part, is_over)
            while 200 not in found and not wrong:
                is_over.wait(0.01)
            found.clear()
            assert alice.http.delete(f"/fits/{fit}").status_code == 204
            is_over.wait(0.2)
            is_over.set()

    assert wrong == []


@pytest.mark.parametrize("output", ["report", "posterior"])
def test_range_request_returns_the_range(alice: Caller, fit: str, output: str) -> None:
    """The response is 206 with the bytes and the total size."""
    whole = alice.http.get(f"/fits/{fit}/{output}").content

    part = alice.http.get(f"/fits/{fit}/{output}", headers={"Range": "bytes=2-4"})

    assert (part.status_code, part.content) == (206, whole[2:5])
    assert part.headers["content-range"] == f"bytes 2-4/{len(whole)}"


@pytest.mark.parametrize(
    ("asked_for", "status"),
    [
        *((text, 400) for text in ("bytes", "bytes=", "bytes=a-b", "lines=1-2", "bytes=3-1")),
        *((text, 416) for text in ("bytes=99999999-", "bytes=-0")),
    ],
)
def test_invalid_range_is_refused_with_a_problem(
    alice: Caller, fit: str, asked_for: str, status: int
) -> None:
    """This holds for outputs and static files; 416 gives the total size."""
    root = str(alice.http.base_url).removesuffix("/api/v1/")
    for address in (f"/fits/{fit}/report", f"/fits/{fit}/posterior", f"{root}/static/motorid.css"):
        answer = alice.http.get(address, headers={"Range": asked_for})

        assert_is_problem(answer, status)
        if status == 416:
            assert re.fullmatch(r"bytes \*/\d+", answer.headers["content-range"])


NAMES = [
    'a"; filename="b.exe',
    "zeile\r\nX-Injected: 1",
    "Prüfstand ☃ 電動機",
    "a" * 190,
    "..\\..\\x",
]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:20])
def test_client_supplied_names_are_in_no_header(alice: Caller, name: str) -> None:
    """Files are named by an ID or a fixed name, whatever the names of run and motor.

    Headers without such names need no escaping by RFC 6266.
    """
    run = alice.upload(run_text(800 + NAMES.index(name)), re.sub(r"[\r\n]", "", name))["id"]
    label = name.replace("\r\n", " ")
    motors = [{"motor": label, "training": [run]}]
    batch = alice.http.post("/batches", json={"name": label, "motors": motors}).json()
    fit = alice.wait(batch["fits"][0]["fit"])["id"]

    answers = {
        address: alice.http.get(address)
        for address in (
            *(f"/runs/{run}", f"/fits/{fit}", f"/fits/{fit}/report", f"/fits/{fit}/posterior"),
            *(f"/batches/{batch['id']}/{part}" for part in ("results.csv", "report")),
        )
    }

    assert {answer.status_code for answer in answers.values()} == {200}
    headers = {address: answer.headers for address, answer in answers.items()}
    shown = {address: sent.get("content-disposition") for address, sent in headers.items()}
    named = {address: text for address, text in shown.items() if text is not None}
    assert named == {
        f"/fits/{fit}/posterior": f'attachment; filename="{fit}.nc"',
        f"/batches/{batch['id']}/results.csv": 'attachment; filename="results.csv"',
    }
    assert not [text for sent in headers.values() for text in sent.values() if label[:9] in text]

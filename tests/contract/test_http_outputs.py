"""Files that the service sends: whole or not at all, in part, and under which name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import httpx
import pytest

from tests.app.service import Caller, Server, run_text
from tests.contract.hostile import assert_is_problem

REPORT = "<!doctype html><title>Report</title><p>x"
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
    """A fit that succeeded."""
    return str(alice.wait(alice.begin(stored)["id"])["id"])


def asked(server: Server, key: str, address: str, is_over: Event) -> Iterator[httpx.Response | str]:
    """Answers to a call that is made again and again, or what was wrong with one."""
    with httpx.Client(base_url=server.url, headers={"Authorization": key}) as caller:
        while not is_over.is_set():
            try:
                yield caller.get(f"/api/v1{address}")
            except httpx.TransportError as error:
                yield repr(error)


def test_output_of_a_fit_that_is_removed_is_whole_or_not_found(
    alice: Caller, server: Server, stored: str
) -> None:
    """Twelve fits, each asked for by six callers at the moment in which it is removed."""
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
def test_part_of_an_output_is_sent_where_it_is_asked_for(
    alice: Caller, fit: str, output: str
) -> None:
    """206, the bytes, and how many there are."""
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
def test_bad_range_is_refused_with_a_problem(
    alice: Caller, fit: str, asked_for: str, status: int
) -> None:
    """Of an output and of a file of the pages alike; 416 says how many bytes there are."""
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
def test_names_of_callers_are_in_no_header(alice: Caller, name: str) -> None:
    """What is saved is named by an id or a word of the service, whatever run and motor are called.

    A header that never holds such a name needs none of the escapes of RFC 6266.
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

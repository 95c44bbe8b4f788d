"""Progress of fits as server-sent events."""

from __future__ import annotations

import json
from collections.abc import Iterator

import httpx

from tests.app.pretended import (
    FAMILY,
    SLOW,
)
from tests.app.service import Caller


def events(answer: httpx.Response) -> Iterator[tuple[str, int, dict[str, object]]]:
    """Name, ID and content of each event of a stream."""
    event: dict[str, str] = {}
    for line in answer.iter_lines():
        field, _, value = line.partition(": ")
        if line:
            event[field] = value
        else:
            if "data" in event:
                yield event["event"], int(event["id"]), json.loads(event["data"])
            event = {}


def test_events_report_progress_and_end_with_the_fit(alice: Caller, stored: str) -> None:
    """Versions and fractions never decrease; the last event is named `end`."""
    fit = alice.begin(stored, seed=SLOW)["id"]

    with alice.http.stream("GET", f"/fits/{fit}/events") as answer:
        heard = list(events(answer))

    assert answer.headers["content-type"].startswith("text/event-stream")
    names = [name for name, _, _ in heard]
    assert names[-1] == "end"
    assert set(names[:-1]) == {"progress"}
    versions = [version for _, version, _ in heard]
    assert versions == sorted(versions)
    fractions = [content["progress"]["fraction"] for _, _, content in heard]  # type: ignore[index]
    assert fractions == sorted(fractions)
    assert len(set(fractions)) >= 4
    assert [content["status"] for _, _, content in heard][-2:] == ["succeeded", "succeeded"]


def test_reconnecting_listener_receives_only_new_events(alice: Caller, stored: str) -> None:
    """A listener that has received the final state gets status 204."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]
    with alice.http.stream("GET", f"/fits/{fit}/events") as answer:
        heard = list(events(answer))
    version = heard[-1][1]

    with alice.http.stream(
        "GET", f"/fits/{fit}/events", headers={"Last-Event-ID": str(version - 1)}
    ) as answer:
        again = list(events(answer))
    after = alice.http.get(f"/fits/{fit}/events", headers={"Last-Event-ID": str(version)})

    assert [name for name, _, _ in heard] == ["progress", "end"]
    assert again == heard
    assert after.status_code == 204


def test_events_keep_a_silent_stream_open(alice: Caller, stored: str) -> None:
    """The server sends a comment after half a second without an event."""
    fit = alice.begin(stored, seed=FAMILY)["id"]
    with alice.http.stream("GET", f"/fits/{fit}/events") as answer:
        comment = next(line for line in answer.iter_lines() if line.startswith(":"))
    alice.http.delete(f"/fits/{fit}")

    assert comment == ": keep-alive"

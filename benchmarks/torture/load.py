"""Load test: many parallel clients and slow uploads, response time of the health check."""

from __future__ import annotations

import math
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

import httpx

from benchmarks.torture import pipeline
from benchmarks.torture.outcome import Outcome
from tests.app.service import Caller, Server, make_key, run_text, serving

__all__ = ["run"]

_PIPELINE = f"{pipeline.__name__}:identify"
_SLOWEST_S = 1.0
_PATIENCE_S = 300.0


@dataclass(frozen=True)
class _Size:
    """Size of the load and limit of the health check's response time.

    Args:
        callers: Number of parallel clients.
        seconds: Duration [s].
        slowest_s: Limit of the 99th percentile of the response time [s].
    """

    callers: int
    seconds: float
    slowest_s: float


@dataclass
class _Seen:
    """Common results of all clients."""

    statuses: Counter[int] = field(default_factory=Counter)
    runs: dict[str, str] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Apply the load, then slow uploads."""
    data_dir = directory / "data"
    keys = [make_key(data_dir, f"bench-{number}") for number in range(8)]
    with serving(data_dir, PIPELINE=_PIPELINE, WORKERS=2) as server:
        return [
            # The short version runs in parallel with other tests, so its times are not reliable.
            *_load(server, keys, _Size(12, 1.5, 10.0) if short else _Size(64, 60.0, _SLOWEST_S)),
            _slow(server, keys[0], _Size(20, 1.0, 10.0) if short else _Size(200, 20.0, _SLOWEST_S)),
        ]


# ---------------------------------------------------------------- load


def _load(server: Server, keys: list[str], size: _Size) -> list[Outcome]:
    seen = _Seen()
    begin = threading.Barrier(size.callers)
    with Caller(server, keys[0]) as caller, _health(server) as waits:
        run_id = caller.upload(run_text(0))["id"]
        # Two fits run at a time; together they last for the whole test.
        number = 2 * math.ceil(size.seconds / pipeline.BURN_S)
        fits = [caller.begin(run_id, seed=pipeline.BURNS)["id"] for _ in range(number)]
        clients = [
            threading.Thread(
                target=_client, args=(server, keys[n % len(keys)], n, size.seconds, begin, seen)
            )
            for n in range(size.callers)
        ]
        for client in clients:
            client.start()
        for client in clients:
            client.join()
        states = {caller.fit(fit)["status"] for fit in fits}
    lost = _lost(server, seen)
    with Caller(server, keys[0]) as caller:
        ends = {caller.wait(fit, seconds=300)["status"] for fit in fits}
    p99 = _quantile(waits, 0.99)
    bad = {s: n for s, n in seen.statuses.items() if s not in (200, 201, 202, 204, 429)}
    counted = ", ".join(f"{status}: {n}" for status, n in sorted(seen.statuses.items()))
    return [
        Outcome(
            f"{size.callers} clients uploading and polling while two fits run",
            "no error except 429, no run lost",
            f"{counted}; {len(seen.runs)} runs accepted, {lost} lost; fits {'/'.join(states)}, "
            f"then {'/'.join(ends)}" + (f"; errors: {seen.errors[:3]}" if seen.errors else ""),
            bool(seen.runs) and not bad and not seen.errors and not lost and ends == {"succeeded"},
        ),
        Outcome(
            "health check during the load",
            f"99th percentile under {size.slowest_s:g} s",
            f"{p99:.3f} s over {len(waits)} calls, slowest {max(waits):.3f} s",
            p99 < size.slowest_s,
        ),
    ]


def _client(
    server: Server, key: str, number: int, seconds: float, begin: threading.Barrier, seen: _Seen
) -> None:
    turn = 0
    with Caller(server, key) as caller:
        caller.http.timeout = httpx.Timeout(_PATIENCE_S)
        # Creating a client takes time; the measurement starts when all exist.
        begin.wait()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            turn += 1
            content = run_text(10_000 * number + turn)
            try:
                sent = caller.http.post("/runs", files={"file": ("a.csv", content)})
                polled = [caller.http.get("/fits?limit=5"), caller.http.get("/runs?limit=5")]
            except httpx.HTTPError as error:
                with seen.lock:
                    seen.errors.append(f"{type(error).__name__}: {error}")
                continue
            with seen.lock:
                seen.statuses.update(answer.status_code for answer in (sent, *polled))
                if sent.status_code == 201:
                    seen.runs[sent.json()["id"]] = key
            if any(answer.status_code == 429 for answer in (sent, *polled)):
                time.sleep(1.0)


def _lost(server: Server, seen: _Seen) -> int:
    """Number of accepted runs that no longer exist, with or without their file."""
    listed: set[str] = set()
    for key in set(seen.runs.values()):
        with Caller(server, key) as caller:
            after: str | None = None
            while True:
                query = {"limit": "1000", **({"after": after} if after else {})}
                page = caller.http.get("/runs", params=query)
                if page.status_code == 429:
                    time.sleep(1.0)
                    continue
                listed |= {run["id"] for run in page.json()["items"]}
                if (after := page.json()["next"]) is None:
                    break
    files = {path.name for path in (server.data_dir / "runs").iterdir()}
    return len(seen.runs.keys() - (listed & files))


# ---------------------------------------------------------------- slow uploads


def _slow(server: Server, key: str, size: _Size) -> Outcome:
    with Caller(server, key) as caller, _slow_uploads(server, key, size.callers) as slow:
        with _health(server) as waits:
            until = time.monotonic() + size.seconds
            took: list[float] = []
            turn = 0
            while time.monotonic() < until:
                turn += 1
                slow.trickle()
                began = time.monotonic()
                caller.upload(run_text(900_000 + turn))
                caller.http.get("/runs?limit=5").raise_for_status()
                took.append(time.monotonic() - began)
                time.sleep(0.2)
        ends = slow.finish()
    p99 = _quantile(waits, 0.99)
    return Outcome(
        f"{size.callers} slow uploads",
        "other requests unaffected",
        f"health 99th percentile {p99:.3f} s, upload and list "
        f"{_quantile(took, 0.5):.3f} s in the median and {max(took):.3f} s at most; slow uploads "
        f"ended with {dict(ends)}",
        p99 < size.slowest_s
        and _quantile(took, 0.9) < 2.0 * size.slowest_s
        and set(ends) <= {200, 201, 429},
    )


class _SlowUploads:
    """Uploads that send a few bytes at long intervals."""

    def __init__(self, server: Server, key: str, number: int) -> None:
        address = urlsplit(server.url)
        head = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n'
        self._left: list[tuple[socket.socket, bytes]] = []
        for place in range(number):
            body = head + run_text(800_000 + place) + b"\r\n--b--\r\n"
            connection = socket.create_connection(
                (address.hostname, address.port), timeout=_PATIENCE_S
            )
            connection.sendall(
                f"POST /api/v1/runs HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n"
                f"Authorization: Bearer {key}\r\nConnection: close\r\n"
                "Content-Type: multipart/form-data; boundary=b\r\n\r\n".encode()
            )
            self._left.append((connection, body))

    def trickle(self) -> None:
        """Send ten bytes of each upload."""
        for place, (connection, body) in enumerate(self._left):
            connection.sendall(body[:10])
            self._left[place] = connection, body[10:]

    def finish(self) -> Counter[int]:
        """Send the rest of each upload; return the number of responses by status."""
        for connection, body in self._left:
            connection.sendall(body)
        ends: Counter[int] = Counter()
        for connection, _ in self._left:
            first = connection.makefile("rb").readline().split()
            ends[int(first[1]) if len(first) > 1 else 0] += 1
        return ends

    def close(self) -> None:
        """Close all connections."""
        for connection, _ in self._left:
            connection.close()


@contextmanager
def _slow_uploads(server: Server, key: str, number: int) -> Iterator[_SlowUploads]:
    slow = _SlowUploads(server, key, number)
    try:
        yield slow
    finally:
        slow.close()


# ---------------------------------------------------------------- health


@contextmanager
def _health(server: Server) -> Iterator[list[float]]:
    """Call the health check continuously; collect its response times [s]."""
    waits: list[float] = []
    is_over = threading.Event()

    def ask() -> None:
        with httpx.Client(base_url=server.url, timeout=_PATIENCE_S) as client:
            while not is_over.wait(0.02):
                began = time.monotonic()
                client.get("/healthz").raise_for_status()
                waits.append(time.monotonic() - began)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield waits
    finally:
        is_over.set()
        thread.join()


def _quantile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, math.ceil(share * len(values)) - 1)]

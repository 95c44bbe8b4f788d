"""Upload of hostile files: each must be refused without effect on the server.

Each must be refused with a 4xx and an error code within 5 s of its last byte.  The process that
reads it may use 2 GB, and the server may grow by 50 MB.
"""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import httpx

from benchmarks.torture.bombs import BOMBS, FLOODS
from benchmarks.torture.outcome import Outcome
from benchmarks.torture.watching import Watch, resident_bytes, watching
from tests.app.service import Caller, Server, run_text, serving

__all__ = ["Answer", "run", "send"]

GIGABYTE = 1_000_000_000
_SLOWEST_S = 5.0
_READING_S = 60.0
"""Limit for texts, which must be read before they can be refused [s]."""
_GROWTH = 50_000_000
_CHILD = 2_000_000_000
_BLOCK_BYTES = 1 << 20
_HEAD = (
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="%s"\r\n'
    b"Content-Type: application/octet-stream\r\n\r\n"
)
_END = b"\r\n--b--\r\n"


@dataclass(frozen=True)
class Answer:
    """Response of a server to a file.

    Args:
        status: HTTP status; 0 if the connection ended without one.
        code: Error code of the problem.
        seconds: Time from the last byte sent to the answer [s].
    """

    status: int
    code: str
    seconds: float

    def is_named(self, within_s: float = _SLOWEST_S) -> bool:
        """Return True if the file was refused with an error code, in time."""
        return 400 <= self.status < 500 and bool(self.code) and self.seconds <= within_s


def send(server: Server, name: str, blocks: Iterator[bytes], size: int | None) -> Answer:
    """Send a file in blocks; without a size, the transfer is chunked."""
    address = urlsplit(server.url)
    connection = http.client.HTTPConnection(str(address.hostname), address.port, timeout=120)
    head = _HEAD % name.encode()
    sent = time.monotonic()
    try:
        connection.putrequest("POST", "/api/v1/runs")
        connection.putheader("Content-Type", "multipart/form-data; boundary=b")
        if size is None:
            connection.putheader("Transfer-Encoding", "chunked")
        else:
            connection.putheader("Content-Length", str(len(head) + size + len(_END)))
        connection.endheaders()
        try:
            for block in _joined(head, blocks):
                data = block if size is not None else b"%x\r\n%s\r\n" % (len(block), block)
                connection.send(data)
                sent = time.monotonic()
            if size is None:
                connection.send(b"0\r\n\r\n")
        except (BrokenPipeError, ConnectionResetError):
            # The server refused the file before its end; its answer may still be readable.
            pass
        answer = connection.getresponse()
        body = answer.read()
        seconds = time.monotonic() - sent
        return Answer(answer.status, str(json.loads(body).get("code", "")), seconds)
    except (ConnectionError, http.client.HTTPException, ValueError):
        return Answer(0, "", time.monotonic() - sent)
    finally:
        connection.close()


def _joined(head: bytes, blocks: Iterator[bytes]) -> Iterator[bytes]:
    yield head
    yield from blocks
    yield _END


def _of_file(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            yield block


def _line(size: int) -> Iterator[bytes]:
    """One line of a CSV file, never in memory as a whole."""
    block = b"1.5," * (_BLOCK_BYTES // 4)
    for _ in range(size // len(block)):
        yield block


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Send every bomb, and a line of 1 GB in three ways."""
    unpacked = 10_000_000 if short else 4 * GIGABYTE
    flood = 5_000_000 if short else GIGABYTE
    answers: dict[str, Answer] = {}
    settings = {"MAX_UPLOAD_BYTES": 3 * GIGABYTE, "READERS": 2}
    with serving(directory / "data", "--no-auth", **settings) as server:
        with Caller(server) as caller:
            caller.upload(run_text(0))
        before = resident_bytes(server.process.pid)
        with watching(server.process.pid) as watch:
            for number, (name, make) in enumerate((BOMBS | FLOODS).items()):
                path = directory / f"bomb-{number}"
                make(path, unpacked if name in BOMBS else flood)
                answers[name] = send(server, name, _of_file(path), path.stat().st_size)
                path.unlink()
            size = flood // _BLOCK_BYTES * _BLOCK_BYTES
            answers["a line, announced"] = send(server, "a.csv", _line(flood), size)
            answers["a line, in chunks"] = send(server, "a.csv", _line(flood), None)
        growth = max(watch.resident, resident_bytes(server.process.pid)) - before
        outcomes = _outcomes(server, answers, watch, growth, flood)
    with serving(directory / "default", "--no-auth") as server:
        # Beyond the default limit: refused by its announced size, or in chunks at the limit.
        limit = 0 if short else GIGABYTE
        beyond = {
            "announced": send(server, "a.csv", _line(limit), limit or 10**9),
            **({} if short else {"in chunks": send(server, "a.csv", _line(limit), None)}),
        }
    shown = ", ".join(f"{n}: {a.status} {a.code or 'hung up'}" for n, a in beyond.items())
    is_refused = all(a.status in (413, 0) for a in beyond.values())
    asked = "413, or the connection ends"
    return [*outcomes, Outcome("1 GB above the size limit", asked, shown, is_refused)]


def _outcomes(
    server: Server, answers: dict[str, Answer], watch: Watch, growth: int, flood: int
) -> list[Outcome]:
    lines = [answer for name, answer in answers.items() if name.startswith("a line")]
    is_alive = httpx.get(f"{server.url}/readyz").status_code == 200
    return [
        _of("bombs and crashing files", {n: answers[n] for n in BOMBS}, _SLOWEST_S),
        _of(f"texts of {flood / 1e9:g} GB", {n: answers[n] for n in FLOODS}, _READING_S),
        Outcome(
            f"one CSV line of {flood / 1e9:g} GB",
            "4xx with an error code within 5 s after its arrival",
            ", ".join(f"{a.status} {a.code} after {a.seconds:.2f} s" for a in lines),
            all(answer.is_named() for answer in lines),
        ),
        Outcome(
            "memory of the reading process",
            "at most 2 GB",
            f"address space {watch.child_space / 1e9:.2f} GB, "
            f"memory {watch.child_resident / 1e9:.2f} GB",
            watch.child_space <= _CHILD,
        ),
        Outcome(
            "memory of the server",
            "alive, grown by at most 50 MB",
            f"{'alive' if is_alive else 'gone'}, grown by {growth / 1e6:.0f} MB",
            is_alive and growth <= _GROWTH,
        ),
    ]


def _of(what: str, answers: dict[str, Answer], within_s: float) -> Outcome:
    wrong = {
        name: (a.status, a.code, round(a.seconds, 1))
        for name, a in answers.items()
        if not a.is_named(within_s)
    }
    slowest = max(answers, key=lambda name: answers[name].seconds)
    return Outcome(
        f"{len(answers)} {what}",
        f"4xx with an error code within {within_s:g} s after the last byte",
        f"slowest {answers[slowest].seconds:.1f} s ({slowest})"
        + (f"; wrong: {wrong}" if wrong else ""),
        not wrong,
    )

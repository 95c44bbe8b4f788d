"""Fuzzing of the reader with mutated run files and mappings: a run or a named error each.

Most files go to the reading process of the service, with one child per file; some come over HTTP.
Equal seeds give equal files.
"""

from __future__ import annotations

import json
import math
import random
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx

from app.errors import RunRefused
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer
from app.runs.reading import RunReader
from benchmarks.torture.mutations import SAMPLES, mutated
from benchmarks.torture.outcome import Outcome
from benchmarks.torture.watching import resident_bytes
from tests.app.service import serving

__all__ = ["run"]

_LIMITS = ProcessLimits(memory_bytes=2_000_000_000, cpu_s=20, wall_s=30.0)
_MAPPINGS = (
    {"speed_rad_s": {"column": "speed_rad_s", "unit": "rpm"}},
    {"current_A": {"column": "current_A", "scale": 2.5, "offset": 0.1}},
    {"time_s": "time_s"},
)


def run(*, short: bool, directory: Path) -> Iterator[Outcome]:
    """Read mutated files of each format, and upload some of them."""
    number = 15 if short else 10_000
    fork_server = ForkServer("app.runs.parser", temporary=directory)
    reader = RunReader(fork_server, _LIMITS, 1_000_000)
    try:
        for name, content in SAMPLES.items():
            files = _files(content, name, number)
            yield _outcome(name, _ends(reader, directory, files))
        mapped = ((SAMPLES["canonical CSV"], mapping) for mapping in _mappings(number))
        yield _outcome("mappings", _ends(reader, directory, mapped))
    finally:
        fork_server.stop()
    yield _over_http(directory, 30 if short else 2000)


def _files(content: bytes, name: str, number: int) -> Iterator[tuple[bytes, None]]:
    chance = random.Random(name)
    return ((mutated(content, chance), None) for _ in range(number))


def _mappings(number: int) -> Iterator[Any]:
    """Mappings that are valid JSON with an invalid structure."""
    chance = random.Random("mappings")
    while number:
        words = json.dumps(chance.choice(_MAPPINGS)).encode()
        try:
            mapping = json.loads(mutated(words, chance), parse_constant=lambda name: None)
        except (ValueError, RecursionError):
            # Invalid JSON is refused before it reaches a reader.
            mapping = _strange(chance)
        number -= 1
        yield mapping


def _strange(chance: random.Random) -> Any:
    leaves: tuple[Any, ...] = (
        None,
        0,
        -1,
        1e308,
        "",
        "x" * 10_000,
        [],
        {},
        True,
        "speed_rad_s",
        "\0",
    )
    leaf: Any = chance.choice(leaves)
    key = chance.choice(("column", "unit", "scale", "offset", "", "x"))
    channel = chance.choice(("speed_rad_s", "current_A", "time_s", "", "torque"))
    entry = {"column": "speed_rad_s", key: leaf}
    return chance.choice(({channel: leaf}, {channel: entry}, {channel: [entry]}, leaf))


def _ends(reader: RunReader, directory: Path, files: Iterator[tuple[bytes, Any]]) -> Counter[str]:
    """Number of readings by outcome: ``run``, an error code, or an exception with ``!``."""

    def end(task: tuple[int, tuple[bytes, Any]]) -> str:
        number, (content, mapping) = task
        path = directory / f"file-{number}"
        path.write_bytes(content)
        try:
            found = reader.read(path, "run.csv", mapping)
        except RunRefused as error:
            return error.reason
        except Exception as error:  # noqa: BLE001  any exception is a finding
            return f"{type(error).__name__}!"
        finally:
            path.unlink()
        return "run" if _is_sound(found) else "no sound run!"

    with ThreadPoolExecutor(2) as pool:
        return Counter(pool.map(end, enumerate(files)))


def _is_sound(found: dict[str, Any]) -> bool:
    numbers = [found["sample_rate_hz"], found["duration_s"]]
    numbers += [limit for channel in found["channels"].values() for limit in channel.values()]
    return found["rows"] >= 10 and all(map(math.isfinite, numbers))


def _outcome(name: str, ends: Counter[str]) -> Outcome:
    wrong = {e: n for e, n in ends.items() if e.endswith("!") or e == "reader_crash"}
    runs, kinds = ends["run"], len(ends) - ("run" in ends)
    measured = f"{runs} runs, {ends.total() - runs} refused with {kinds} error codes"
    return Outcome(
        f"{ends.total()} mutated files: {name}",
        "each a run or a named error",
        measured + (f"; wrong: {wrong}" if wrong else ""),
        not wrong,
    )


def _over_http(directory: Path, number: int) -> Outcome:
    chance = random.Random("http")
    ends: Counter[str] = Counter()
    with (
        serving(directory / "data", "--no-auth") as server,
        httpx.Client(base_url=f"{server.url}/api/v1", timeout=60) as client,
    ):
        before = resident_bytes(server.process.pid)
        for _ in range(number):
            content = mutated(chance.choice(list(SAMPLES.values())), chance)
            answer = client.post("/runs", files={"file": ("run.csv", content)})
            body = answer.json()
            is_named = answer.status_code in (200, 201) or body.get("code")
            ends[f"{answer.status_code}" if is_named else "unnamed"] += 1
        growth = resident_bytes(server.process.pid) - before
        is_alive = client.get("/readyz").status_code == 200
    return Outcome(
        f"{number} mutated files over HTTP",
        "2xx, or 4xx with an error code; the server survives",
        f"{dict(sorted(ends.items()))}, server grown by {growth / 1e6:.0f} MB",
        is_alive and set(ends) <= {"200", "201", "413", "422"},
    )

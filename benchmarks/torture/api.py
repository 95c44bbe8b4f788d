"""Property-based test of the HTTP interface with schemathesis: no answer may be a 5xx.

The cases come from the OpenAPI description of the server; `api_hooks` puts real runs into some of
them, without which no fit would begin.  Schemathesis and the server both count the responses.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import httpx

from benchmarks.torture import api_hooks
from benchmarks.torture.outcome import Outcome
from tests.app.service import Caller, Server, make_key, run_text, serving

__all__ = ["run"]

_CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
)
_SAMPLE = re.compile(r'motorid_http_requests_total\{.*status="(\d+)"\} (\S+)')
_FEWEST = 5000


def run(*, short: bool, directory: Path) -> list[Outcome]:
    """Call all routes, at random and in sequences."""
    key = make_key(directory / "data")
    settings = {"RATE_PER_S": 0, "MAX_UPLOAD_BYTES": 10**6, "KEEP_ALIVE_S": 1}
    with serving(directory / "data", **settings) as server, Caller(server, key) as caller:
        runs = [str(caller.upload(run_text(seed))["id"]) for seed in range(10 if short else 40)]
        phases = "fuzzing,stateful" if short else "examples,coverage,fuzzing,stateful"
        words = ["--phases", phases, "--max-examples", "3" if short else "500"]
        report = _schemathesis(server, key, runs, directory, words)
        statuses = _statuses(server)
    cases, failures = report["test_cases"], report["failures"]
    fewest = 40 if short else _FEWEST
    bad = {status: number for status, number in statuses.items() if status >= "5"}
    begun = statuses["202"]
    return [
        Outcome(
            "schemathesis, stateful",
            f"at least {fewest} cases, no 5xx, responses as described",
            f"{cases['generated']} cases, {cases['with_failures']} not as described, "
            f"{cases['errored']} errors"
            + (f": {_named(failures)}" if failures else "")
            + (f"; stopped: {report['stop_reason']}" if not report["complete"] else ""),
            cases["generated"] >= fewest
            and not cases["with_failures"] + cases["errored"]
            and report["complete"],
        ),
        Outcome(
            "responses counted by the server",
            "no 5xx, at least one fit accepted",
            ", ".join(f"{status}: {number:g}" for status, number in sorted(statuses.items())),
            not bad and begun > 0,
        ),
    ]


def _schemathesis(
    server: Server, key: str, runs: list[str], directory: Path, words: list[str]
) -> dict[str, Any]:
    """Report of schemathesis."""
    report = directory / "report.json"
    hooks = {"SCHEMATHESIS_HOOKS": api_hooks.__name__, api_hooks.RUNS: ",".join(runs)}
    done = subprocess.run(
        [
            *(str(Path(sys.executable).with_name("schemathesis")), "run"),
            *(f"{server.url}/api/v1/openapi.json", "--header", f"Authorization: Bearer {key}"),
            *("--checks", ",".join(_CHECKS), "--seed", "1", "--continue-on-failure", "--no-color"),
            *("--no-shrink", "--suppress-health-check", "all", "--generation-database", "none"),
            *("--request-timeout", "60", "--report", "json", "--report-json-path", str(report)),
            *words,
        ],
        env=os.environ | hooks | {"PYTHONPATH": str(Path(__file__).parents[2])},
        # schemathesis would store its findings for the next run.
        cwd=directory,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if not report.exists():
        raise RuntimeError(f"schemathesis ended without a report:\n{done.stdout}{done.stderr}")
    found: dict[str, Any] = json.loads(report.read_text())
    return found


def _statuses(server: Server) -> Counter[str]:
    """Number of responses of the server by status."""
    found: Counter[str] = Counter()
    for status, number in _SAMPLE.findall(httpx.get(f"{server.url}/metrics").text):
        found[status] += int(float(number))
    return found


def _named(failures: list[Any]) -> str:
    return "; ".join(json.dumps(failure)[:300] for failure in failures[:5])

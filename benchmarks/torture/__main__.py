"""Runs the torture tests and writes their table.

    python -m benchmarks.torture [--short] [--only kills,files] [--out FILE.md]

Each module of `MODULES` has one function, `run(short, directory)`, that starts the servers which
it needs on loopback, ends them, and gives a list of outcomes.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.torture.outcome import Outcome

MODULES = ("kills", "throughput", "files", "fuzz", "api", "access", "load", "limits", "batches")
_TABLE = Path("docs/benchmarks/torture.md")


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for; the status is 1 where something failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.torture", description=__doc__)
    parser.add_argument("--short", action="store_true", help="minutes in place of hours")
    parser.add_argument("--only", default=",".join(MODULES), help="modules, separated by commas")
    parser.add_argument("--out", type=Path, default=_TABLE, help="Markdown file of the table")
    chosen = parser.parse_args(arguments)
    outcomes: list[Outcome] = []
    for name in chosen.only.split(","):
        module = importlib.import_module(f"benchmarks.torture.{name}")
        began = time.monotonic()
        with tempfile.TemporaryDirectory(prefix=f"motorid-{name}-") as directory:
            for outcome in module.run(short=chosen.short, directory=Path(directory)):
                outcomes.append(outcome)
                print(f"{'pass' if outcome.passed else 'FAIL'}  {outcome.test}: {outcome.measured}")
        print(f"      {name}: {time.monotonic() - began:.0f} s")
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(table(outcomes, short=chosen.short), encoding="utf-8")
    return 0 if all(outcome.passed for outcome in outcomes) else 1


def table(outcomes: list[Outcome], *, short: bool) -> str:
    """The outcomes as Markdown."""
    command = f"make torture{' ARGS=--short' if short else ''}"
    lines = [
        "# Torture",
        "",
        f"Made by `{command}`.",
        "",
        "| test | asked | measured | |",
        "|---|---|---|---|",
    ]
    for outcome in outcomes:
        verdict = "pass" if outcome.passed else "**fail**"
        lines.append(f"| {outcome.test} | {outcome.asked} | {outcome.measured} | {verdict} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())

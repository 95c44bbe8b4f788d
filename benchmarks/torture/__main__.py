"""Run the stress tests and write their page.

    python -m benchmarks.torture [--short] [--only kills,files] [--out FILE.md]

Each module of `MODULES` has a function `run(short, directory)` that starts its servers on loopback,
stops them, and returns or yields outcomes.  Each module has its own section of the page, which is
replaced when the module has finished; the sections can therefore be made separately.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.torture.document import section, with_section
from benchmarks.torture.outcome import Outcome

MODULES = (
    "kills",
    "jobs",
    "throughput",
    "files",
    "fuzz",
    "api",
    "access",
    "load",
    "limits",
    "batches",
)
_TABLE = Path("docs/benchmarks/torture.md")


def main(arguments: list[str] | None = None) -> int:
    """Run the chosen modules; the exit status is 1 after a failure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.torture", description=__doc__)
    parser.add_argument(
        "--short", action="store_true", help="short version: minutes instead of hours"
    )
    parser.add_argument("--only", default=",".join(MODULES), help="modules, separated by commas")
    parser.add_argument("--out", type=Path, default=_TABLE, help="Markdown file of the page")
    chosen = parser.parse_args(arguments)
    has_passed = True
    for name in chosen.only.split(","):
        began = time.monotonic()
        outcomes = _run(name, short=chosen.short)
        seconds = time.monotonic() - began
        print(f"      {name}: {seconds:.0f} s", flush=True)
        has_passed &= all(outcome.passed for outcome in outcomes)
        text = chosen.out.read_text(encoding="utf-8") if chosen.out.exists() else ""
        words = section(name, outcomes, short=chosen.short, seconds=seconds)
        chosen.out.parent.mkdir(parents=True, exist_ok=True)
        chosen.out.write_text(with_section(text, name, words, MODULES), encoding="utf-8")
    return 0 if has_passed else 1


def _run(name: str, *, short: bool) -> list[Outcome]:
    module = importlib.import_module(f"benchmarks.torture.{name}")
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix=f"motorid-{name}-") as directory:
        for outcome in module.run(short=short, directory=Path(directory)):
            outcomes.append(outcome)
            verdict = "pass" if outcome.passed else "FAIL"
            print(f"{verdict}  {outcome.test}: {outcome.measured}", flush=True)
    return outcomes


if __name__ == "__main__":
    sys.exit(main())

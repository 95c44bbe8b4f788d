"""Identification of motors from realistic test bench recordings.

    python -m benchmarks.benches [--first 0] [--count 120] [--rows 24000] [--case encoder:clean]
    python -m benchmarks.benches --withhold cogging_torque --case everything_angle --count 4

Campaign n belongs to cell n modulo the number of cells, so the first n campaigns are a balanced
sample; the number determines the campaign.  Each campaign appends one line of JSON to the log, and
campaigns in the log are not repeated, so a log must contain campaigns of one setting.  The page is
generated from the whole log.  `benchmarks.benches.cases` defines the correct answers.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.benches.campaign import Settings, isolated, wanted
from benchmarks.benches.cases import CASES, CELLS
from benchmarks.benches.table import page
from identification.effects.catalogue import CATALOGUE

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Identify the campaigns that are missing from the log and write the page."""
    chosen = _arguments(arguments)
    settings = Settings(chosen.rows, chosen.posterior, tuple(chosen.withhold))
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    lines: list[dict[str, Any]] = []
    if chosen.log.exists():
        lines = [json.loads(line) for line in chosen.log.read_text("utf-8").splitlines()]
    known = {line["number"] for line in lines}
    for number in wanted(chosen.first, chosen.count, chosen.case):
        if number in known:
            continue
        line = isolated(number, settings)
        lines.append(line)
        with chosen.log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(line) + "\n")
        print(json.dumps(line), flush=True)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    intervals = "sampled" if chosen.posterior else "from the covariance of the fit"
    chosen.out.write_text(page(lines, _command(chosen), chosen.rows, intervals), encoding="utf-8")


def _command(chosen: argparse.Namespace) -> str:
    words = f"python -m benchmarks.benches --first {chosen.first} --count {chosen.count}"
    words += f" --rows {chosen.rows}"
    words += f" --case {chosen.case}" if chosen.case else ""
    words += " --posterior" if chosen.posterior else ""
    return words + "".join(f" --withhold {kind}" for kind in chosen.withhold)


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.benches", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign")
    parser.add_argument("--count", type=int, default=120, help="campaigns")
    parser.add_argument("--rows", type=int, default=24_000, help="samples a run")
    names = [*CASES, *(cell.name for cell in CELLS)]
    parser.add_argument("--case", choices=names, metavar="CASE", help="only of this case")
    parser.add_argument("--posterior", action="store_true", help="sample it; long")
    parser.add_argument(
        "--withhold",
        action="append",
        default=[],
        choices=list(CATALOGUE),
        metavar="KIND",
        help="a kind of effect that the search must not add",
    )
    parser.add_argument("--log", type=Path, default=Path("out/benches.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/benches.md"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()

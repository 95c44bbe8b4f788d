"""Calibration of intervals and probabilities on simulated campaigns.

    python -m benchmarks.calibration [--campaigns 400] [--first 0] [--log out/calibration.jsonl]

    python -m benchmarks.calibration --withheld [--campaigns 182] [--log out/withheld.jsonl]

The number determines the campaign.  Each campaign appends one line of JSON to the log, and those in
the log are not repeated, so an interrupted measurement can be resumed.  The page is generated from
the whole log; its hand-written findings are kept.

With `--withheld`, only the campaigns with a withheld effect are identified, each without and with
that effect, and another page compares the intervals.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Final

from benchmarks.calibration.campaign import measured
from benchmarks.calibration.page import figures, page
from benchmarks.calibration.plan import Item, item_of
from benchmarks.calibration.statistics import Line
from benchmarks.calibration.withheld import both_measured, comparison

__all__ = ["main"]

_HEADING: Final = "## Findings\n"
"""Heading of the hand-written last part of the page, which a new measurement keeps."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Identify the campaigns that are missing from the log and write the page."""
    chosen = _arguments(arguments)
    numbers = range(chosen.first, chosen.first + chosen.campaigns)
    command = f"python -m benchmarks.calibration --campaigns {chosen.campaigns}"
    command += f" --first {chosen.first}"
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    if chosen.withheld:
        pairs = _logged(chosen.log, numbers, both_measured)
        text = comparison(pairs, f"{command} --withheld", _processor(), _findings(chosen.out))
        chosen.out.write_text(text, encoding="utf-8")
        return
    lines = _logged(chosen.log, numbers, measured)
    text = page(lines, command, _processor(), _findings(chosen.out))
    chosen.out.write_text(text, encoding="utf-8")
    pictures = chosen.out.parent.parent / "pictures" / "calibration"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, drawing in figures(lines).items():
        (pictures / name).write_text(drawing, encoding="utf-8")


def _logged(
    path: Path, numbers: Iterable[int], measure: Callable[[Item], Line | None]
) -> list[Line]:
    """Lines of the log, completed by those of the numbers that it lacks."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = []
    if path.exists():
        lines = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    known = {line["number"] for line in lines}
    for number in numbers:
        line = None if number in known else measure(item_of(number))
        if line is not None:
            lines.append(line)
            with path.open("a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")
            print(json.dumps(line), flush=True)
    return lines


def _findings(out: Path) -> str:
    """Hand-written findings of the page that is replaced, with their heading; empty if none."""
    old = out.read_text("utf-8") if out.exists() else ""
    return old[old.index(_HEADING) :] if _HEADING in old else ""


def _processor() -> str:
    """Name of the processor and number of its cores."""
    listed = Path("/proc/cpuinfo")
    text = listed.read_text("utf-8") if listed.exists() else ""
    found = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    name = found[1] if found else platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores"


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--campaigns", type=int, default=400, help="number of campaigns")
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign")
    parser.add_argument(
        "--withheld",
        action="store_true",
        help="identify the campaigns with a withheld effect also with that effect, and compare",
    )
    parser.add_argument(
        "--log", type=Path, help="default out/calibration.jsonl or out/withheld.jsonl"
    )
    parser.add_argument("--out", type=Path, help="page; default docs/benchmarks/<same name>.md")
    chosen = parser.parse_args(arguments)
    name = "withheld" if chosen.withheld else "calibration"
    chosen.log = chosen.log or Path(f"out/{name}.jsonl")
    chosen.out = chosen.out or Path(f"docs/benchmarks/{name}.md")
    return chosen


if __name__ == "__main__":
    main()

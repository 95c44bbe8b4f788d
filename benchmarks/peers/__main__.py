"""Comparison with other programs in one run: posterior, fit, terms, whole loop and arithmetic.

    python -m benchmarks.peers --peers .venv-peers/bin/python [--only fit,loop] [--long]

Each measurement is a process and appends one line of JSON to the log.  Measurements in the log are
not repeated, so an interrupted run can be continued and its parts can be measured separately.  The
page and its plots are generated from the whole log.  `--long` adds ten million samples.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.peers.plan import PARTS, Measurement, plan

__all__ = ["main", "measured"]

SIZES = (10_000, 100_000, 1_000_000)
_LONG = 10_000_000
_LIMIT_S = 3600.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what is missing from the log and write the page and its plots."""
    chosen = _arguments(arguments)
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    lines: list[dict[str, Any]] = []
    if chosen.log.exists():
        lines = [json.loads(line) for line in chosen.log.read_text("utf-8").splitlines()]
    known = {line["key"] for line in lines}
    sizes = tuple(int(float(word)) for word in chosen.rows.split(",")) if chosen.rows else SIZES
    sizes = (*sizes, _LONG) if chosen.long else sizes
    for measurement in plan(chosen.only, sizes, chosen.repeats):
        if measurement.key in known:
            continue
        line = measured(measurement, chosen.peers, chosen.log.parent)
        lines.append(line)
        with chosen.log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(line) + "\n")
        said = line.get("failed") or f"{line['elapsed_s']:.1f} s, {line['peak_mb']:.0f} MB"
        print(f"{measurement.key}: {said}", flush=True)
    # Imported late: the memory of a child starts from that of its parent.
    from benchmarks.peers.page import page  # noqa: PLC0415
    from benchmarks.peers.plots import plots  # noqa: PLC0415

    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    command = "make peers" + (" ARGS=--long" if chosen.long else "")
    chosen.out.write_text(page(lines, command, _machine()), encoding="utf-8")
    pictures = chosen.out.parent.parent / "pictures" / "peers"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, drawing in plots(lines).items():
        (pictures / name).write_text(drawing, encoding="utf-8")
    print(f"written to {chosen.out}")


def measured(measurement: Measurement, peers: str, folder: Path) -> dict[str, Any]:
    """Line of the log of one measurement; ``failed`` holds the message if there is no result.

    Args:
        measurement: The process to run.
        peers: Interpreter with the packages of the peers.
        folder: Folder of data files.
    """
    words = [word.format(**_files(measurement, folder)) for word in measurement.words]
    python = peers if measurement.is_peer else sys.executable
    begun = time.perf_counter()
    line: dict[str, Any] = {
        "key": measurement.key,
        "part": measurement.part,
        "name": measurement.name,
        "rows": measurement.rows,
        "effect": measurement.effect,
    }
    try:
        line |= _run(python, words)
    except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
        line["failed"] = str(error)
    return line | {"elapsed_s": time.perf_counter() - begun}


def _files(measurement: Measurement, folder: Path) -> dict[str, str]:
    """Data files that the command names, made if they do not exist."""
    rows, effect = measurement.rows, measurement.effect
    files: dict[str, str] = {}
    maker: list[str] = []
    if "{task}" in measurement.words:
        files["task"] = str(folder / f"task-{rows}.npz")
        maker = ["problem", files["task"], "--rows", str(rows)]
    elif "{campaign}" in measurement.words:
        files["campaign"] = str(
            folder / f"campaign-{rows}-{effect.replace('=', '-') or 'clean'}.npz"
        )
        maker = ["campaigns", files["campaign"], "--rows", str(rows), "--effect", effect]
    for path in files.values():
        if not Path(path).exists():
            _run(sys.executable, maker)
    return files


def _run(python: str, words: Sequence[str]) -> dict[str, Any]:
    """Result of a module of this package in its own process, with an empty cache of loops.

    Raises:
        RuntimeError: The process failed; the message is its last line.
    """
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [python, "-m", f"benchmarks.peers.{words[0]}", *words[1:]],
            capture_output=True,
            text=True,
            timeout=_LIMIT_S,
            env=os.environ
            | {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive", "MOTORID_CACHE": cache},
            check=False,
        )
    if done.returncode != 0:
        said = (done.stderr.strip() or "no message").splitlines()[-1]
        raise RuntimeError(f"exit status {done.returncode}: {said}")
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def _machine() -> str:
    """Processor, cores, memory, system and Python."""
    listed = Path("/proc/cpuinfo")
    text = listed.read_text("utf-8") if listed.exists() else ""
    found = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    name = found[1] if found else platform.processor() or platform.machine()
    vectors = "AVX-512" if "avx512f" in text else "AVX2" if "avx2" in text else "no AVX2"
    return f"{name}, {os.cpu_count()} cores, {vectors}, Python {platform.python_version()}"


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.peers", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "--peers", default=".venv-peers/bin/python", help="interpreter of the peers"
    )
    parser.add_argument(
        "--only",
        type=lambda words: [word for word in words.split(",") if word],
        default=list(PARTS),
        metavar="PARTS",
        help=f"parts to measure, of {','.join(PARTS)}",
    )
    parser.add_argument("--rows", default="", help="sizes instead of 1e4,1e5,1e6")
    parser.add_argument("--repeats", type=int, default=1, help="repetitions of samplers and fits")
    parser.add_argument("--long", action="store_true", help="ten million samples as well")
    parser.add_argument("--log", type=Path, default=Path("out/peers/log.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/peers.md"))
    chosen = parser.parse_args(arguments)
    unknown = [part for part in chosen.only if part not in PARTS]
    if unknown:
        parser.error(f"--only has {unknown[0]!r}; expected parts of {', '.join(PARTS)}")
    return chosen


if __name__ == "__main__":
    main()

"""First paint, zoom time and size of a report with long runs, in a real browser on loopback.

    python -m benchmarks.report_page [--rows 200000] [--out docs/benchmarks/report-page.md]

Needs playwright and a Chromium on the machine.  A campaign of the bench simulator with a hidden
brush drop is fitted without sampling; the report is served on 127.0.0.1 and loaded several times.
First paint is that of the browser's own clock (First Contentful Paint).  A zoom is a click on a
button; its time ends after the next frame, in which all panels are drawn again.
"""

from __future__ import annotations

import argparse
import functools
import shutil
import statistics
import sys
import tempfile
import threading
from collections.abc import Sequence
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Final

from playwright.sync_api import Browser, sync_playwright

from bench.campaign import EffectRequest, make_campaign
from identification.options import FitOptions
from identification.pipeline import identify
from identification.result.atomic import write_text

__all__ = ["main", "measure"]

_LOADS: Final = 5
_ZOOMS: Final = ("in", "in", "later", "earlier", "out", "all", "in", "all")

_ZOOM: Final = """how => {
  const start = performance.now();
  document.querySelector(`[data-zoom="${how}"]`).click();
  return new Promise(done => requestAnimationFrame(() => {
    const channel = new MessageChannel();
    channel.port1.onmessage = () => done(performance.now() - start);
    channel.port2.postMessage(0);
  }));
}"""
_PAINT: Final = "performance.getEntriesByName('first-contentful-paint')[0].startTime"


class _Silent(SimpleHTTPRequestHandler):
    """File handler without a log."""

    def log_message(self, *_: object) -> None:
        """Discard the line."""


def measure(page: Path) -> dict[str, float]:
    """Medians over several loads: first paint, drawn run, zoom; and the slowest zoom [ms].

    Args:
        page: A report.
    """
    handler = functools.partial(_Silent, directory=str(page.parent))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            address = f"http://127.0.0.1:{server.server_port}/{page.name}"
            loads = [_load(browser, address) for _ in range(_LOADS)]
            browser.close()
    finally:
        server.shutdown()
    zooms = [time for load in loads for time in load[2]]
    return {
        "first paint": statistics.median(load[0] for load in loads),
        "run drawn": statistics.median(load[1] for load in loads),
        "zoom, median": statistics.median(zooms),
        "zoom, slowest": max(zooms),
    }


def _load(browser: Browser, address: str) -> tuple[float, float, list[float]]:
    """First paint, time until the first run is drawn, and the time of each zoom [ms]."""
    tab = browser.new_page(viewport={"width": 1280, "height": 900})
    tab.goto(address, wait_until="commit")
    tab.wait_for_selector("#panels canvas", state="attached")
    drawn = float(tab.evaluate("performance.now()"))
    tab.wait_for_selector("html[data-ready]", state="attached")
    paint = float(tab.evaluate(_PAINT))
    zooms = [float(tab.evaluate(_ZOOM, how)) for how in _ZOOMS]
    tab.close()
    return paint, drawn, zooms


def _report(folder: Path, rows: int) -> Path:
    """Report of two training runs and one validation run with `rows` samples each."""
    effects = (EffectRequest("brush_drop", 0.03, "knee"),)
    make_campaign("servo_150w", effects, 23, rows=rows).write(folder)
    training = [folder / f"training_{k}.csv" for k in (1, 2)]
    options = FitOptions(posterior=False, effort="quick")
    identify(training, folder / "validation_1.csv", options).write(folder / "out")
    return folder / "out" / "report.html"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rows", type=int, default=200_000, help="samples of each run")
    parser.add_argument("--report", type=Path, help="an existing report instead of a new fit")
    parser.add_argument("--out", type=Path, help="Markdown page to write; default: print it")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        page = given.report or _report(Path(folder), given.rows)
        size, found = page.stat().st_size, measure(page)
    lines = [
        "# Time and size of a report",
        "",
        f"A report of three runs with {given.rows:,} samples each, in headless Chromium on "
        f"loopback without a graphics processor; medians of {_LOADS} loads.",
        "`make report-page` writes this page.",
        "",
        "| | measured | limit |",
        "|---|---|---|",
        f"| size | {size / 1e6:.2f} MB | 2 MB |",
        f"| first paint | {found['first paint']:.0f} ms | 1000 ms |",
        f"| first run decoded and drawn | {found['run drawn']:.0f} ms | |",
        f"| zoom, median | {found['zoom, median']:.0f} ms | 50 ms |",
        f"| zoom, slowest | {found['zoom, slowest']:.0f} ms | 50 ms |",
        "",
    ]
    text = "\n".join(lines)
    if given.out:
        write_text(given.out, text)
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()

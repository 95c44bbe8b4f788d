"""The report in a real browser, if one is installed: its script runs under its own policy."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from identification.reporting.html import render_report
from tests.reports import make_report

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
SWITCHES = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-logging=stderr", "--virtual-time-budget=4000", "--window-size=1200,900",
)  # fmt: skip


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_script_draws_every_panel_of_a_run_without_a_console_message(tmp_path: Path) -> None:
    """Speed, current, both residuals, voltage and temperature give six plots."""
    page = tmp_path / "report.html"
    page.write_text(render_report(make_report(with_effect=True)), encoding="utf-8")
    profile = f"--user-data-dir={tmp_path / 'profile'}"

    shown = subprocess.run(
        [str(BROWSER), *SWITCHES, profile, "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip

    assert len(re.findall(r'class="panel"', shown.stdout)) == 6
    assert re.search(r'<div class="chart"[^>]*>.*?class="uplot', shown.stdout)
    assert re.search(
        r'<h3 id="detail-title">bench_validation_5.csv \(validation\)</h3>', shown.stdout
    )
    assert not re.search(r"CONSOLE|Refused to|Uncaught", shown.stderr)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_print_shows_every_run_and_a_small_screen_readable_text(tmp_path: Path) -> None:
    """Seven runs with six panels each; no text of the page is smaller than 11 px at 390 px."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    page = tmp_path / "report.html"
    page.write_text(render_report(make_report(rows=600, with_effect=True)), encoding="utf-8")
    smallest = """() => Math.min(...[...document.querySelectorAll('main *, header *')]
      .filter(e => [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim()))
      .filter(e => !['SCRIPT', 'STYLE'].includes(e.tagName) && !e.closest('math'))
      .map(e => parseFloat(getComputedStyle(e).fontSize)))"""

    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 390, "height": 844})
        tab.goto(page.as_uri())
        tab.wait_for_selector("html[data-ready]", state="attached")
        size, width = tab.evaluate(smallest), tab.evaluate("document.body.scrollWidth")
        table = tab.locator("[aria-label=Parameters]")
        is_scrolled = table.evaluate("table => table.scrollWidth > table.clientWidth")
        tab.evaluate("dispatchEvent(new Event('beforeprint'))")
        printed = [
            tab.locator(f"#sheets {kind}").count() for kind in ("h3", ".panel", ".panel canvas")
        ]
        tab.evaluate("dispatchEvent(new Event('afterprint'))")
        left = tab.locator("#sheets *").count()
        browser.close()

    assert size >= 11.0
    assert width == 390
    assert not is_scrolled
    assert printed == [7, 42, 42]
    assert left == 0

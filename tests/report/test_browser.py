"""The report in a real browser, if one is installed: its script runs under its own policy."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from identification.report.html import render_report
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

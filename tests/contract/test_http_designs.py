"""Designs of the next run by HTTP and on their page."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from app.cli import main
from tests.app.analysed import Bench


def test_designed_run_by_http_is_the_one_of_the_command_line(bench: Bench, tmp_path: Path) -> None:
    """Equal inputs give equal files; the page offers the same file for the same fields."""
    stored = tmp_path / "result.json"
    fit = bench.http.get(f"/api/v1/fits/{bench.second}").json()
    stored.write_text(json.dumps(fit["result"]), encoding="utf-8")
    words = ["--limit", "current=2", "--narrow", "J", "--temperature", "40"]
    assert main(["design", str(stored), "--out", str(tmp_path / "next.csv"), *words, "-q"]) == 0
    expected = (tmp_path / "next.csv").read_text(encoding="utf-8")
    body = {"fit": bench.second, "limits": {"current": 2.0}, "narrow": "J", "temperatures": [40.0]}

    answer = bench.http.post("/api/v1/designs", json=body)
    query = {"limits": "current=2", "narrow": "J", "temperature": "40"}
    page = bench.http.get(f"/fits/{bench.second}/design", params=query)
    file = bench.http.get(f"/fits/{bench.second}/design.csv", params=query)

    assert answer.status_code == 200
    assert answer.json()["table"] == expected == file.text
    assert answer.json()["design"]["predicted_peaks"]["current"] <= 2.0
    assert "Expected 90 % interval of J" in page.text
    assert "voltage [V]</text>" in page.text, "the profile is plotted"
    assert re.search(r'<code>L</code> <span class="unit">\[[mµ]H\]', page.text)
    assert "design.csv?limits=current%3D2" in page.text


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ({}, "nameplate"),
        ({"fit": "{second}", "limits": {"torque": 1.0}}, "torque"),
        ({"fit": "{second}", "narrow": "Rb"}, "Ra25"),
        ({"nameplate": "voltage=12"}, "no_load_speed"),
        ({"fit": "{second}", "duration": -1.0}, "duration"),
    ],
)
def test_refused_design_says_what_is_expected(
    bench: Bench, body: dict[str, object], word: str
) -> None:
    """The problem names the field or the accepted values."""
    own = {k: v.format(second=bench.second) if isinstance(v, str) else v for k, v in body.items()}

    answer = bench.http.post("/api/v1/designs", json=own)

    assert answer.status_code == 422
    assert word in answer.text


def test_first_run_of_a_nameplate_needs_no_fit(bench: Bench) -> None:
    """The nameplate gives 3 ohm, and the stall current limits the run."""
    plate = "voltage=12,no_load_speed=3000rpm,stall_current=4"

    answer = bench.http.post("/api/v1/designs", json={"nameplate": plate, "narrow": "Ra25"}).json()

    assert answer["design"]["narrow"]["value"] == pytest.approx(3.0)
    assert answer["design"]["predicted_peaks"]["current"] <= 4.0


def test_page_of_the_design_keeps_what_was_typed_wrongly(bench: Bench) -> None:
    """The field has its text, and the message says what is expected."""
    page = bench.http.get(f"/fits/{bench.second}/design", params={"limits": "current=<b>"})

    assert page.status_code == 422
    assert 'value="current=&lt;b&gt;"' in page.text
    assert "positive number in A" in page.text

"""End-to-end test with the real pipeline: run files of a known motor in, parameters out."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from identification.result.schema import result_schema
from tests.app.analysed import Bench
from tests.app.service import Caller

DATA = Path(__file__).parents[2] / "data"
CAMPAIGN = DATA / "clean_servo"


@pytest.fixture
def caller(bench: Bench) -> Iterator[Caller]:
    """Client of a service with the real pipeline."""
    with Caller(bench.server) as made:
        yield made


def test_motor_is_identified_from_its_run_files_over_http(caller: Caller) -> None:
    """Three clean runs at three temperatures are fitted without posterior and effect search.

    Each parameter is within five standard deviations or 0.5 % of the simulated motor's value.
    """
    truth = json.loads((CAMPAIGN / "truth.json").read_text(encoding="utf-8"))["parameters"]
    runs = [
        caller.upload((CAMPAIGN / f"training_{n}.csv").read_bytes(), f"training_{n}.csv")["id"]
        for n in (1, 2, 3)
    ]
    fit = caller.begin(*runs, posterior=False, effects=False)
    fit = caller.wait(fit["id"], seconds=120)
    report = caller.http.get(f"/fits/{fit['id']}/report").text

    assert fit["status"] == "succeeded", fit["error"]
    Draft202012Validator(result_schema()).validate(fit["result"])
    for name, entry in fit["result"]["parameters"].items():
        value = truth[name]["value"] if isinstance(truth[name], dict) else truth[name]
        assert abs(entry["median"] - value) < max(5 * entry["sd"], 0.005 * abs(value)), name
    assert report.lower().startswith("<!doctype html>")
    assert "training_1.csv" in report


def test_a_fit_of_contradictory_runs_fails_with_its_findings(caller: Caller, bench: Bench) -> None:
    """One run has a reversed current sensor; with this run set aside the fit succeeds."""
    content = (CAMPAIGN / "training_1.csv").read_bytes()
    sound = caller.upload(content, "training_1.csv")["id"]
    other = (CAMPAIGN / "training_2.csv").read_bytes()
    flip = {"current_A": {"column": "current_A", "scale": -1.0}}
    wrong = caller.upload(other, "training_2.csv", mapping=json.dumps(flip))["id"]
    refused = caller.begin(sound, wrong, posterior=False, effects=False)
    refused = caller.wait(refused["id"], seconds=120)
    page = bench.http.get(f"/fits/{refused['id']}").text
    without = caller.begin(sound, wrong, posterior=False, effects=False, set_aside=True)
    without = caller.wait(without["id"], seconds=120)

    assert refused["status"] == "failed"
    assert refused["error"]["code"] == "contradictory_runs"
    [finding] = refused["error"]["findings"]
    assert (finding["file"], finding["column"]) == ("training_2.csv", "current_A")
    # A second scale of -1 restores the sign.
    assert finding["corrections"] == ["training_2.csv:current_A=current_A * 1"]
    # The page gives the correction in its own fields and no option of the command line.
    assert "Correction: current from column current_A, sign +." in page
    assert "--set-aside" not in page
    assert without["status"] == "succeeded", without["error"]
    assert [run["file"] for run in without["result"]["set_aside"]] == ["training_2.csv"]


def test_a_run_in_rpm_of_a_motor_with_much_friction_is_refused(
    caller: Caller, bench: Bench
) -> None:
    """Current and speed are in proportion; the three other runs show the unit of the fourth."""
    folder = DATA / "paper_motor"
    rpm = {"speed_rad_s": {"column": "speed_rad_s", "scale": 60.0 / math.tau}}
    names = [f"training_{k}.csv" for k in range(1, 5)]
    ids = [
        caller.upload((folder / name).read_bytes(), name, mapping=mapping)["id"]
        for name, mapping in zip(names, ["{}", "{}", "{}", json.dumps(rpm)], strict=True)
    ]
    fit = caller.begin(*ids, posterior=False, effects=False)
    fit = caller.wait(fit["id"], seconds=120)
    page = bench.http.get(f"/fits/{fit['id']}").text

    assert (fit["status"], fit["error"]["code"]) == ("failed", "contradictory_runs")
    [finding] = fit["error"]["findings"]
    assert (finding["code"], finding["file"]) == ("scaled_channel", names[3])
    assert finding["corrections"] == [f"{names[3]}:speed_rad_s=speed_rad_s * 1"]
    assert "probably in rpm" in page

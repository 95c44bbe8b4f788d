"""Analyses of fits by HTTP and on their pages, with the real pipeline."""

from __future__ import annotations

import csv
import html
import io
import re
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

from identification.ingest import read_run
from identification.prediction import predict
from motorid.client import Client
from tests.app.analysed import MOTOR, Bench
from tests.app.browser import needs_browser, show


def test_loop_by_http_agrees_with_the_result(bench: Bench) -> None:
    """The same controller and temperature give the final value of result.json within 1 %."""
    result = bench.http.get(f"/api/v1/fits/{bench.second}").json()["result"]

    answer = bench.http.post(
        f"/api/v1/fits/{bench.second}/feedback",
        json={"controllers": ["P:1"], "temperatures": [25.0, 125.0]},
    ).json()

    for found, own in zip(answer["feedback"], result["feedback"], strict=True):
        assert found["controller"] == own["controller"]
        assert found["steady_state"]["median"] == pytest.approx(
            own["steady_state"]["median"], rel=0.01
        )
    assert len(answer["steps"]) == 2
    assert {len(step["median"]) for step in answer["steps"]} == {300}


def test_refused_controller_is_a_problem(bench: Bench) -> None:
    """The problem names the controller."""
    answer = bench.http.post(
        f"/api/v1/fits/{bench.second}/feedback", json={"controllers": ["PD:1,2"]}
    )

    assert answer.status_code == 422
    assert "PD:1,2" in answer.json()["detail"]


def test_tuning_by_http_agrees_with_the_judgement_of_its_controller(bench: Bench) -> None:
    """Judging the gains that were found gives the probability that was found."""
    address = f"/api/v1/fits/{bench.second}/tunings"
    asked = {
        "specification": {"settling_time": 0.2, "overshoot": 10, "voltage": 24, "current": 20},
        "temperatures": [25.0],
    }

    [found] = bench.http.post(address, json=asked).json()["tuning"]["controllers"]
    again = bench.http.post(address, json=asked | {"controllers": [found["controller"]]}).json()

    assert found["controller"].startswith("PI:")
    assert again["tuning"]["controllers"][0]["probability"] == found["probability"]
    assert len(again["remarks"]) == 1


def test_refused_specification_is_a_problem(bench: Bench) -> None:
    """The problem names every unknown requirement."""
    answer = bench.http.post(
        f"/api/v1/fits/{bench.second}/tunings", json={"specification": {"rise": 1, "fall": 1}}
    )

    assert answer.status_code == 422
    assert "rise, fall is not known" in answer.json()["detail"]


def test_page_of_the_loop_is_a_form_with_its_answer(bench: Bench) -> None:
    """The address has all fields, so a reload shows the same response without a script."""
    query = {"kind": "PI", "kp": "0.5", "ki": "3", "temperature": "25, 80"}

    page = bench.http.get(f"/fits/{bench.second}/loop", params=query)

    assert page.status_code == 200
    assert "PI:0.5,3" in page.text
    assert "Step responses with PI:0.5,3" in page.text
    assert re.search(r'name="temperature"[^>]*value="25, 80"', page.text)


def test_page_of_a_specification_shows_its_controller(bench: Bench) -> None:
    """The form keeps the fields; the answer has a figure and the table of the required metrics."""
    address = f"/fits/{bench.second}/tuning"
    query = {"kind": "PI", "overshoot": "10", "settling_time": "0.2", "voltage": "24"}

    empty = bench.http.get(address)
    page = bench.http.get(address, params=query | {"temperature": "25"})

    assert (empty.status_code, page.status_code) == (200, 200)
    assert "draws meet the specification" not in empty.text
    assert re.search(r"<code>PI:[^<]*</code>: \S+ % of 200 draws meet the specification", page.text)
    assert re.search(r'name="settling_time"[^>]*value="0.2"', page.text)
    assert "<svg" in page.text
    assert "met in 100\u00a0%" in page.text


def test_page_of_a_specification_names_each_fault(bench: Bench) -> None:
    """Both fields stand in the message, and keep their text."""
    query = {"overshoot": "<i>", "delay": "x"}

    page = bench.http.get(f"/fits/{bench.second}/tuning", params=query)

    assert page.status_code == 422
    assert 'value="&lt;i&gt;"' in page.text
    assert "delay &#39;x&#39; is not a number" in page.text


def test_page_keeps_what_was_typed_wrongly(bench: Bench) -> None:
    """The field has its text, and the message says what is expected."""
    page = bench.http.get(f"/fits/{bench.second}/loop", params={"kp": "<b>"})

    assert page.status_code == 422
    assert 'value="&lt;b&gt;"' in page.text
    assert "which is not a number" in page.text


def test_page_of_a_motor_lists_its_fits_and_draws_its_history(bench: Bench) -> None:
    """Both fits are linked, and each plot has the estimates of both."""
    page = bench.http.get("/motor", params={"name": MOTOR})

    assert page.status_code == 200
    assert "<h1" in page.text
    assert "servo &lt;1&gt;" in page.text
    for fit in (bench.first, bench.second):
        assert f'href="/fits/{fit}"' in page.text
    plots = page.text.count(" over the fits</title>")
    assert 0 < plots <= 7
    assert plots <= page.text.count('<path class="stem') <= 2 * plots


def test_first_page_leads_to_the_history_and_to_the_comparison(bench: Bench) -> None:
    """Every fit of a named motor links to the motor's page, and the bar to the comparison."""
    shown = bench.http.get("/", headers={"accept": "text/html"}).text

    assert 'href="/compare"' in shown
    assert shown.count(f'href="/motor?name={quote(MOTOR)}"') == 2


def test_unknown_motor_has_a_page_that_says_so(bench: Bench) -> None:
    """A motor exists by its fits only."""
    page = bench.http.get("/motor", params={"name": "none"})

    assert page.status_code == 200
    assert "No fit of this motor" in page.text


def test_comparison_puts_the_older_fit_first(bench: Bench) -> None:
    """The order of the address does not matter; the fits share one training run."""
    page = bench.http.get("/compare", params={"fit": [bench.second, bench.first]})

    assert page.status_code == 200
    assert page.text.index(f'href="/fits/{bench.first}"') < page.text.index(
        f'href="/fits/{bench.second}"'
    )
    assert "share 1 training run " in page.text
    assert "Step responses with P:1 at 125 °C" in page.text


@pytest.mark.parametrize(("count", "words"), [(0, ""), (1, ""), (2, "Select two different fits")])
def test_comparison_without_two_fits_is_a_form(bench: Bench, count: int, words: str) -> None:
    """The form lists the succeeded fits; one fit, as from its page, is not a mistake."""
    page = bench.http.get("/compare", params={"fit": [bench.first] * count})

    assert page.status_code == 200
    assert words in page.text
    assert ("Select two different fits" in page.text) == bool(words)
    assert f'<option value="{bench.second}"' in page.text


def test_predicted_training_run_has_the_error_of_the_fit(bench: Bench) -> None:
    """The first fit has one training run, so its simulation error is that of this run."""
    result = bench.http.get(f"/api/v1/fits/{bench.first}").json()["result"]

    answer = bench.http.get(f"/api/v1/fits/{bench.first}/predictions/{bench.runs[0]}").json()

    for channel in ("current", "speed"):
        expected = result["errors"]["after"]["training"][channel]
        for name in ("rmse", "nrmse", "noise_ratio"):
            assert answer["errors"][channel][name] == pytest.approx(expected[name], rel=0.01)


def test_run_hotter_than_the_fitted_one_is_an_extrapolation(bench: Bench) -> None:
    """The answer and the page say so; the training run itself has no remark."""
    fitted, hotter = (
        bench.http.get(f"/api/v1/fits/{bench.first}/predictions/{run}").json()["remarks"]
        for run in bench.runs[:2]
    )
    page = bench.http.get(f"/fits/{bench.first}/prediction", params={"run": bench.runs[1]})

    assert fitted == []
    (remark,) = hotter
    assert "leaves the range of the fitted runs" in remark
    assert "temperature 70.0 to 102 °C, fitted 25.0 to 56.4 °C" in remark
    assert f"{remark}." in html.unescape(page.text)


def test_predicted_run_with_a_reversed_sensor_says_so(bench: Bench) -> None:
    """The answer and the page name the channel and the correction; the table is available."""
    mapping = {"current_A": {"column": "current_A", "scale": -1.0}}
    with Client(str(bench.http.base_url)) as client:
        run = client.upload(bench.files[0], motor=MOTOR, mapping=mapping).id
    address = f"/api/v1/fits/{bench.first}/predictions/{run}"

    # The wrong initial state may leave the range of the fitted runs, too.
    remark, *_ = bench.http.get(address).json()["remarks"]
    page = bench.http.get(f"/fits/{bench.first}/prediction", params={"run": run})

    assert "column current_A: has the wrong sign" in remark
    assert "“Mapping” of the run, or its member mapping" in remark
    assert f"{remark}." in html.unescape(page.text)
    assert bench.http.get(f"{address}.csv").status_code == 200
    bench.http.delete(f"/api/v1/runs/{run}")


@pytest.mark.parametrize("declared", [False, True])
def test_table_of_a_prediction_is_that_of_the_library(bench: Bench, declared: bool) -> None:
    """A run that the fit has not seen, sample by sample."""
    result = bench.http.get(f"/api/v1/fits/{bench.first}").json()["result"]
    expected = predict(result, read_run(bench.files[1]), declared)

    answer = bench.http.get(
        f"/api/v1/fits/{bench.first}/predictions/{bench.runs[1]}.csv",
        params={"declared": declared},
    )

    header, *rows = csv.reader(io.StringIO(answer.text))
    assert answer.headers["content-type"].startswith("text/csv")
    assert header == ["time_s", "current_A", "speed_rad_s"]
    time, current, speed = np.array(rows, dtype=np.float64).T
    np.testing.assert_array_equal(time, expected["time_s"])
    np.testing.assert_allclose(current, expected["current_A"], rtol=1e-9)
    np.testing.assert_allclose(speed, expected["speed_rad_s"], rtol=1e-9)


@pytest.mark.parametrize("ending", ["", ".csv"])
def test_prediction_of_an_unknown_run_is_not_found(bench: Bench, ending: str) -> None:
    """An ID of another form is an unknown run, too."""
    for run in ("run_aaaaaaaaaaaaaaaaaaaaaaaaaa", "x"):
        answer = bench.http.get(f"/api/v1/fits/{bench.first}/predictions/{run}{ending}")

        assert answer.status_code == 404


def test_page_of_a_prediction_draws_measured_and_simulated(bench: Bench) -> None:
    """Two lines in each of two panels, and a link to the table."""
    page = bench.http.get(f"/fits/{bench.first}/prediction", params={"run": bench.runs[1]})

    assert page.status_code == 200
    assert page.text.count('class="line measured"') == 2
    assert page.text.count('class="line after thin"') == 2
    assert f"/predictions/{bench.runs[1]}.csv" in page.text
    assert re.search(rf'value="{bench.runs[0]}"[^<]*training run', page.text)


@needs_browser
@pytest.mark.parametrize(
    "page",
    [
        "fits/{first}/tuning?kind=PI&overshoot=10&temperature=25",
        "compare?fit={first}&fit={second}",
    ],
)
def test_page_in_a_browser_is_quiet(bench: Bench, tmp_path: Path, page: str) -> None:
    """The console is empty, and all requests go to this service."""
    base = str(bench.http.base_url).rstrip("/")

    shown = show(f"{base}/{page.format(first=bench.first, second=bench.second)}", tmp_path)

    assert shown.console == []
    assert [address for address in shown.requests if not address.startswith(f"{base}/")] == []
    assert "<svg" in shown.dom

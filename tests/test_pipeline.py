"""Input that `identify` refuses, and warnings of its result."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from identification import FitOptions, InputError, OptionError, Run, identify, read_run
from identification.ingest import write_run
from identification.prediction import model_of
from identification.quantities import DECLARED_PARAMETERS
from identification.result.draws import chain_draws
from tests.motors import campaign, motor_named

RUN = campaign(motor_named("servo 100 W"), seed=1)[0]


def _with(channel: str, values: NDArray[np.float64]) -> Run:
    changed: dict[str, Any] = {channel: values}
    return replace(RUN, **changed)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e150])
@pytest.mark.parametrize("channel", ["voltage", "speed", "temperature"])
def test_a_value_that_no_sensor_logs_is_refused_with_its_sample(channel: str, value: float) -> None:
    """Runs may come from other sources than the reader; 1e150 is finite, its square is not."""
    values = np.asarray(getattr(RUN, channel)).copy()
    values[7] = value

    with pytest.raises(InputError, match=r"sample 7 is .*; expected a finite value below 1e\+15"):
        identify([RUN], [_with(channel, values)])


def test_repeated_time_is_refused() -> None:
    """Two samples at one time have no interval."""
    time = RUN.time.copy()
    time[5] = time[4]

    with pytest.raises(InputError, match="time does not increase"):
        identify([replace(RUN, time=time)])


def test_one_run_and_a_path_as_text_are_enough(tmp_path: Path) -> None:
    """A single run and a string give the result of lists and a path."""
    options = FitOptions(effects=False, posterior=False)

    told: list[str] = []
    single = identify(RUN, RUN, options, lambda stage, fraction: told.append(stage))
    single.write(str(tmp_path / "out"))

    assert single.result["parameters"] == identify([RUN], [RUN], options).result["parameters"]
    assert (tmp_path / "out" / "result.json").is_file()
    # No posterior is computed, so the progress names none.
    assert list(dict.fromkeys(told)) == ["fit", "intervals", "feedback", "report", "done"]


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_prediction_holds_the_voltage_as_the_fit_did(hold: Literal["zoh", "foh"]) -> None:
    """The model of a stored result has the hold that the user gave to the fit."""
    options = FitOptions(effects=False, posterior=False, hold=hold)

    model, _ = model_of(identify(RUN, options=options).result, declared=True)

    assert model.hold == hold


def test_paths_of_run_files_stand_for_their_runs(tmp_path: Path) -> None:
    """Text and path, alone and in a list: the runs are those that `read_run` returns."""
    path = tmp_path / "run.csv"
    write_run(RUN, path)
    options = FitOptions(effects=False, posterior=False)

    found = identify(str(path), [path], options)

    expected = identify(read_run(path), read_run(path), options)
    assert found.result == expected.result
    assert found.result["runs"][0]["channels"]["speed_rad_s"] == {
        "column": "speed_rad_s",
        "unit": "rad/s",
        "scale": 1.0,
        "offset": 0.0,
    }


@pytest.mark.parametrize("options", [None, {}, "quick"])
def test_options_that_are_none_are_refused_with_their_type(options: Any) -> None:
    """A dictionary in place of FitOptions reads what was expected."""
    with pytest.raises(InputError, match=r"options is a \w+; expected FitOptions"):
        identify([RUN], options=options)


@pytest.mark.parametrize("given", [None, 3, [RUN, None], {"training": 1}.values()])
def test_an_object_that_is_no_run_is_refused_with_its_type(given: Any) -> None:
    """A caller that passes None or a number reads what was expected."""
    with pytest.raises(InputError, match=r"training has an object of type \w+; expected a Run"):
        identify(given)


def test_an_unknown_withheld_effect_is_refused_with_the_known_ones() -> None:
    """A misspelt effect type would otherwise be searched."""
    with pytest.raises(OptionError, match="the kind 'coulomb'; expected .*coulomb_friction"):
        identify([RUN], withheld=["coulomb"])


def test_a_deficient_nominal_model_gives_a_warning_without_a_search() -> None:
    """A brush drop of 0.5 V is some 20 times the noise; the clean run has no warning."""
    options = FitOptions(effects=False, posterior=False)
    dropped = _with("voltage", RUN.voltage + 0.5 * np.sign(RUN.current))

    sound, lacking = (
        str(identify([run], (), options).result["warnings"]) for run in (RUN, dropped)
    )

    assert "times the sensor noise" not in sound
    assert "the nominal model does not explain the current of the training runs" in lacking
    assert "run the effect search (fit without --no-effects)" in lacking


def test_isolated_outliers_are_reported_with_channel_and_number() -> None:
    """Five isolated samples deviate by 5 A, 200 times the noise; two adjacent ones do not count."""
    at = np.array([50, 120, 121, 200, 260, 310, 350])
    spiked = RUN.current.copy()
    spiked[at] += np.array([5.0, -5.0, -5.0, 5.0, 5.0, -5.0, 5.0])
    options = FitOptions(effects=False, posterior=False)

    sound, said = (
        str(identify([run], (), options).result["warnings"])
        for run in (RUN, _with("current", spiked))
    )

    assert "isolated outliers" not in sound
    assert f"{RUN.name}, column current_A: 5 isolated outliers: the residual exceeds 10" in said


def test_warnings_about_the_result_precede_those_about_the_files() -> None:
    """Without temperature, the open coefficients matter more than their cause."""
    runs = [replace(RUN, temperature=None)]

    result = identify(runs, (), FitOptions(effects=False, posterior=False)).result
    said, details = result["warnings"], result["warning_details"]

    assert isinstance(said, list)
    assert isinstance(details, list)
    found = [
        next(k for k, message in enumerate(said) if message.startswith(words))
        for words in ("the runs do not determine alpha_Ra", "the runs have no temperature")
    ]
    assert found == [0, len(said) - 1]
    codes = [one["code"] for one in details]
    assert (codes[0], codes[-1]) == ("parameters_not_identified", "unknown_temperature")
    assert all(message.endswith(one["fix"]) for message, one in zip(said, details, strict=True))


def test_correlation_is_that_of_the_posterior_draws(tmp_path: Path) -> None:
    """Independent reference: NumPy on all draws of posterior.nc; the result uses some of them.

    Above 25 degC, Ra25 (1 + alpha_Ra (T - 25)) is determined better than its two factors, so their
    correlation is negative.
    """
    identify(RUN, (), FitOptions(effects=False, effort="quick")).write(tmp_path)
    stored = json.loads((tmp_path / "result.json").read_text())["correlation"]
    with (tmp_path / "posterior.nc").open("rb") as file:
        draws = chain_draws(file, 1_000_000)

    names, matrix = stored["names"], np.array(stored["matrix"])
    assert names[:7] == list(DECLARED_PARAMETERS)
    assert matrix == pytest.approx(np.corrcoef([draws[n] for n in names]), abs=0.05)
    assert matrix[0, 1] < -0.5

"""Known values as priors: used if the runs leave a parameter open, rejected on conflict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from identification import FitOptions, Run, identify
from identification.fit import knowledge
from identification.fit.knowledge import LIMIT
from identification.fit.solve import Fit, solve
from identification.fleet.refit import refit_of
from identification.ingest import read_run
from tests.motors import NAMES, Motor, campaign, motor_named

SERVO = motor_named("servo 100 W")
PAPER_RUN = Path(__file__).parents[2] / "data" / "paper_motor" / "training_1.csv"
SLOW = Motor("slow bench", motor_named("coreless 10 W").values, 24.0, 5e-3, 40)
"""Motor with an electrical time constant of 0.1 ms on a bench of 200 Hz."""


def fitted(runs: list[Run], **options: Any) -> dict[str, Any]:
    """Result of a fit of the nominal model to runs whose voltage is held between samples."""
    return identify(runs, (), FitOptions(effects=False, hold="zoh", **options)).result


def quick(runs: list[Run], **options: Any) -> dict[str, Any]:
    """Result of the same fit without sampling."""
    return fitted(runs, posterior=False, **options)


@pytest.fixture(scope="module")
def servo_runs() -> list[Run]:
    """Runs that determine all seven parameters."""
    return campaign(SERVO, seed=3, runs=3, rows=800)


@pytest.fixture(scope="module")
def servo(servo_runs: list[Run]) -> dict[str, Any]:
    """Result without any known value."""
    return quick(servo_runs)


@pytest.fixture(scope="module")
def slow_runs() -> list[Run]:
    """Runs at 200 Hz with 10 % noise, which do not determine the inductance."""
    return campaign(SLOW, seed=5, runs=3, rows=600, noise=0.1)


def test_limit_is_that_of_one_false_alarm_in_a_thousand_motors() -> None:
    """Seven two-sided comparisons share the probability."""
    assert 7 * 2 * norm.sf(LIMIT) == pytest.approx(1e-3)


@pytest.mark.parametrize("posterior", [False, True])
def test_known_inductance_is_used_where_the_runs_leave_it_open(
    slow_runs: list[Run], posterior: bool
) -> None:
    """Fit and sampler both return the given spread of 10 %."""
    before = quick(slow_runs)["parameters"]["L"]
    result = fitted(slow_runs, posterior=posterior, known=("L=2.5e-4+-10%",))
    after = result["parameters"]["L"]

    assert not before["identified"]
    assert before["sd"] > 0.3 * before["median"]
    assert after["median"] == pytest.approx(2.5e-4, rel=0.05)
    assert after["sd"] == pytest.approx(0.1 * after["median"], rel=0.15)
    assert after["identified"]
    assert after["prior"] == {
        "value": 2.5e-4,
        "sd": pytest.approx(2.5e-5),
        "origin": "--known",
        "used": True,
        "identified_by_runs": False,
    }
    assert "L: from --known (known values), not from the runs" in result["warnings"]


def test_known_coefficient_gives_the_reference_values_away_from_25_degc() -> None:
    """With runs at 80 degC only, Ra25 = R(80) / (1 + alpha 55); the coefficient limits its sd."""
    hot = [
        replace(run, temperature=np.full(run.rows, 80.0))
        for run in campaign(
            replace(SERVO, values=(0.6 * 1.2145, 0.0, 0.07 * 0.934, 0.0, *SERVO.values[4:])),
            seed=4,
        )
    ]
    before = quick(hot)["parameters"]
    after = quick(hot, known=("alpha_Ra=0.0039+-1%", "alpha_Kt=-0.0012+-1%"))["parameters"]

    for name, truth in (("Ra25", 0.6), ("Kt25", 0.07)):
        assert after[name]["median"] == pytest.approx(truth, rel=0.01)
        assert after[name]["sd"] < 0.2 * before[name]["sd"]
    assert after["alpha_Ra"]["sd"] == pytest.approx(3.9e-5, rel=0.1)
    assert after["alpha_Ra"]["identified"]
    assert not after["alpha_Ra"]["prior"]["identified_by_runs"]


@pytest.mark.parametrize(
    "word", ["Kt25=0.05+-5%", "Kt25=0.1", "J=1e-5", "L=0.02+-20%", "b=1e-3+-10%", "alpha_Ra=0.002"]
)
def test_wrong_value_is_the_first_warning_and_has_no_influence(
    servo_runs: list[Run], servo: dict[str, Any], word: str
) -> None:
    """The estimate equals that of the runs alone, digit for digit."""
    name = word.partition("=")[0]
    result = quick(servo_runs, known=(word,))

    entry = result["parameters"][name]
    assert entry["prior"]["used"] is False
    assert entry["prior"]["identified_by_runs"] is True
    assert {k: v for k, v in entry.items() if k != "prior"} == servo["parameters"][name]
    assert result["warnings"][0].startswith(f"{name} is ")
    assert "by --known (known values), but" in result["warnings"][0]
    assert "the fit did not use the given value" in result["warnings"][0]


def test_value_within_chance_moves_a_well_determined_parameter_less_than_its_sd(
    servo_runs: list[Run], servo: dict[str, Any]
) -> None:
    """A Kt that is 3 % too large, given to 1 %, deviates by 3 sd, which chance may explain."""
    result = quick(servo_runs, known=("Kt25=0.0721",))

    before, after = (one["parameters"]["Kt25"] for one in (servo, result))
    assert after["prior"]["used"] is True
    assert abs(after["median"] - before["median"]) < before["sd"]
    assert result["warnings"] == servo["warnings"]


def test_right_values_are_used_and_reported_as_identified_by_the_runs(
    servo_runs: list[Run], servo: dict[str, Any]
) -> None:
    """All seven true values at 1 % cause no warning and widen no interval."""
    words = tuple(f"{n}={v!r}" for n, v in zip(NAMES, SERVO.values, strict=True))
    result = quick(servo_runs, known=words)

    assert result["warnings"] == servo["warnings"]
    for name, entry in result["parameters"].items():
        assert entry["prior"]["used"] is True
        assert entry["prior"]["identified_by_runs"] is True
        assert entry["sd"] < 1.05 * servo["parameters"][name]["sd"], name


PLATE = "voltage=24,no_load_speed=3249rpm,no_load_current=0.3,stall_current=40"
"""Nameplate of the servo: stall current 24 V / 0.6 ohm, speed (24 - 0.6 0.3) / 0.07 rad/s."""


def test_right_nameplate_leaves_a_well_determined_motor_alone(
    servo_runs: list[Run], servo: dict[str, Any]
) -> None:
    """The priors of the nameplate are wide compared with the uncertainty of the fit."""
    result = quick(servo_runs, nameplate=PLATE)

    assert result["warnings"] == servo["warnings"]
    for name in NAMES:
        before, after = (one["parameters"][name] for one in (servo, result))
        assert abs(after["median"] - before["median"]) < 0.1 * before["sd"]
    assert result["parameters"]["Kt25"]["prior"]["origin"] == "--nameplate"


@pytest.mark.parametrize(
    ("channel", "factor", "correction"),
    [
        ("speed", 30 / np.pi, "--map 'speed_rad_s=speed_rad_s * 0.10471975512'"),
        ("current", 1e3, "--map 'current_A=current_A * 0.001'"),
    ],
)
def test_nameplate_finds_runs_in_another_unit(
    servo_runs: list[Run], channel: str, factor: float, correction: str
) -> None:
    """If all runs are in rpm or mA, only the nameplate reveals the wrong unit."""
    runs = [replace(run, **{channel: factor * getattr(run, channel)}) for run in servo_runs]

    result = quick(runs, nameplate=PLATE)

    assert "by --nameplate (nameplate), but" in result["warnings"][0]
    assert correction in result["warnings"][0]


def test_nameplate_without_its_unit_is_found(servo_runs: list[Run], servo: dict[str, Any]) -> None:
    """With 3249 read as rad/s, the estimates are those of the runs."""
    result = quick(servo_runs, nameplate=PLATE.replace("rpm", ""))

    assert "if a speed of the nameplate is in rpm, append rpm to it" in result["warnings"][0]
    median = servo["parameters"]["J"]["median"]
    assert result["parameters"]["J"]["median"] == pytest.approx(median, rel=1e-6)


def test_known_inertia_identifies_the_resistance_without_a_current() -> None:
    """Without current, only J Ra and L / Ra are determined; a known J identifies all three."""
    runs = campaign(SERVO, seed=7, runs=3, rows=600)
    dead = [replace(run, current=np.zeros(run.rows)) for run in runs]

    before = quick(dead, force=True)["parameters"]
    after = quick(dead, force=True, known=("J=1e-4+-2%",))["parameters"]

    for name, truth in (("Ra25", 0.6), ("L", 2e-3)):
        assert not before[name]["identified"]
        assert after[name]["identified"]
        assert "prior" not in after[name]
        assert after[name]["median"] == pytest.approx(truth, abs=4 * after[name]["sd"])


@pytest.mark.parametrize("wrong", ["Ra25=1.2", "L=8e-3"])
def test_one_of_two_values_that_contradict_only_together_is_rejected(wrong: str) -> None:
    """Without current, the runs determine only the ratios of J, Ra25 and L."""
    runs = campaign(SERVO, seed=7, runs=3, rows=600)
    dead = [replace(run, current=np.zeros(run.rows)) for run in runs]
    name = wrong.partition("=")[0]

    alone = quick(dead, force=True, known=(wrong,))
    both = quick(dead, force=True, known=("J=1e-4", wrong))

    assert alone["parameters"][name]["prior"]["used"] is True
    used = {n: both["parameters"][n]["prior"]["used"] for n in ("J", name)}
    assert sorted(used.values()) == [False, True]
    refused = next(n for n, is_used in used.items() if not is_used)
    assert both["warnings"][0].startswith(f"{refused} is ")


def test_value_with_which_no_fit_is_found_is_not_used(
    servo_runs: list[Run], servo: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the solver fails with the user's prior, the estimate is that of the runs."""

    def lost(*arguments: Any) -> Fit:
        """Fit whose cost is set to infinity."""
        return replace(solve(*arguments), cost=np.inf)

    monkeypatch.setattr(knowledge, "solve", lost)
    result = quick(servo_runs, known=("Kt25=0.07",))

    entry = result["parameters"]["Kt25"]
    assert entry.pop("prior")["used"] is False
    assert entry == servo["parameters"]["Kt25"]
    assert "no fit with it and the other known values succeeded" in result["warnings"][0]


def test_known_coefficient_of_runs_without_temperature_keeps_its_spread(
    servo_runs: list[Run],
) -> None:
    """Without a known value, the coefficient would be drawn from its prior (sd 0.003 1/K)."""
    runs = [replace(run, temperature=None) for run in servo_runs]

    entry = quick(runs, known=("alpha_Ra=0.0039+-2%",))["parameters"]["alpha_Ra"]

    assert entry["prior"]["used"] is True
    assert entry["median"] == pytest.approx(0.0039, rel=0.01)
    assert entry["sd"] == pytest.approx(7.8e-5, rel=0.1)


@pytest.mark.parametrize("word", ["Kt25=0.071+-2%", "Kt25=0.07+-5%"])
def test_a_known_value_does_not_make_a_parameter_identified_by_the_runs(word: str) -> None:
    """One run of the paper's motor gives Kt = 0.060 +- 0.022, which is not identified."""
    runs = [read_run(PAPER_RUN)]

    alone = quick(runs)["parameters"]["Kt25"]
    result = quick(runs, known=(word,))

    assert not alone["identified"]
    assert result["parameters"]["Kt25"]["prior"]["used"] is True
    assert result["parameters"]["Kt25"]["prior"]["identified_by_runs"] is False
    assert "Kt25: from --known (known values), not from the runs" in result["warnings"]


def test_known_value_has_no_drift_in_a_fleet(slow_runs: list[Run]) -> None:
    """A parameter determined by its prior has no drift."""
    result = quick(slow_runs, known=("L=2.5e-4+-10%",))

    refit = refit_of("pump", "fitted", result)

    assert not refit.estimates["L"].is_identified
    assert refit.estimates["Kt25"].is_identified

"""Implausible time constants give a warning; those of data sheets do not."""

from __future__ import annotations

from typing import Any

import pytest

from bench import EffectRequest, make_campaign
from benchmarks.coverage import run_of
from identification import FitOptions, identify
from identification.checks.plausible import time_constant_findings
from identification.reporting.warnings import warning_groups

TRUSTED = dict.fromkeys(("Ra25", "Kt25", "J", "L"), True)

# Terminal resistance [ohm], torque constant [N m/A], inertia [kg m^2], inductance [H].
DATA_SHEETS = {
    "Faulhaber 0816K003SR": (5.4, 2.11e-3, 0.051e-7, 53e-6),
    "Faulhaber 1331T024SR": (52.9, 21.8e-3, 0.63e-7, 1100e-6),
    "Faulhaber 3863H024CR": (0.64, 39.8e-3, 120e-7, 180e-6),
    "printed B9M4": (0.85, 4.72e-2, 395e-7, 100e-6),
    "printed BR27MACH": (0.18, 46.1e-2, 74000e-7, 100e-6),
}


def values_of(
    resistance: float, constant: float, inertia: float, inductance: float
) -> dict[str, float]:
    """Parameters by name."""
    return {"Ra25": resistance, "Kt25": constant, "J": inertia, "L": inductance}


@pytest.mark.parametrize("name", DATA_SHEETS)
def test_motor_of_a_data_sheet_is_plausible(name: str) -> None:
    """Values from manufacturers' data sheets give no warning."""
    assert time_constant_findings(values_of(*DATA_SHEETS[name]), TRUSTED) == []


@pytest.mark.parametrize("factor", [30.0, 1000.0])
def test_lag_of_a_sensor_in_the_inductance_is_reported(factor: float) -> None:
    """For 8 ms instead of 0.28 ms, the warning names the sensor and a check of L."""
    resistance, constant, inertia, inductance = DATA_SHEETS["Faulhaber 3863H024CR"]
    (found,) = time_constant_findings(
        values_of(resistance, constant, inertia, factor * inductance), TRUSTED
    )

    assert found.code == "electrical_time_constant"
    assert found.severity == "suspect"
    assert found.value == pytest.approx(factor * inductance / resistance)
    assert "current sensor" in found.message
    assert "--known L=VALUE" in found.message


@pytest.mark.parametrize(
    ("factor", "word"),
    [(0.01, "rotor without load"), (100.0, "gear"), (1000.0, "is 4.85 s, expected at most 200 ms")],
)
def test_inertia_far_from_that_of_a_rotor_is_reported(factor: float, word: str) -> None:
    """A 3863 CR has 4.8 ms by its data sheet; 0.05 ms, 0.5 s and 5 s are implausible."""
    resistance, constant, inertia, inductance = DATA_SHEETS["Faulhaber 3863H024CR"]
    (found,) = time_constant_findings(
        values_of(resistance, constant, factor * inertia, inductance), TRUSTED
    )

    assert found.code == "mechanical_time_constant"
    assert word in found.message
    assert "--known J=VALUE" in found.message


def test_remedy_of_an_implausible_time_constant_is_in_the_message_once() -> None:
    """The report shows the remedy apart from the cause; the warning's text has it as before."""
    resistance, constant, inertia, inductance = DATA_SHEETS["Faulhaber 3863H024CR"]
    found = time_constant_findings(
        values_of(resistance, constant, 100.0 * inertia, 100.0 * inductance), TRUSTED
    )
    warnings = [one.warning() for one in found]
    (group,) = warning_groups(
        {"warnings": list(map(str, warnings)), "warning_details": [w.details() for w in warnings]}
    )

    assert [item.fix for item in group.items] == [
        "Measure L with an LCR meter and give --known L=VALUE",
        "Compare J with the data sheet and give --known J=VALUE",
    ]
    for one, warning, item in zip(found, warnings, group.items, strict=True):
        assert str(warning) == (
            f"{one.column}: {one.message} ({one.statistic} {one.value:.3g}, limit {one.limit:.3g})"
        )
        assert str(warning).count(warning.fix) == 1
        assert "--known" not in item.message
        assert item.service == "“Known values”, or option known"


def test_parameter_that_is_not_identified_is_not_checked() -> None:
    """An inductance that is not identified, or given by the user, says nothing about the sensor."""
    values = values_of(0.64, 39.8e-3, 120e-7, 1.0)

    assert time_constant_findings(values, TRUSTED | {"L": False}) == []


def test_result_of_a_slow_current_sensor_reports_both_findings() -> None:
    """With 0.1 ms behind a filter of 8 ms, L is not identified and its lag is implausible."""
    hidden = make_campaign(
        "coreless_10w", [EffectRequest("current_filter", size=0.8)], seed=2, rows=1500
    )
    runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(hidden.training)]
    options = FitOptions(posterior=False, effects=False)
    result: Any = identify(runs, options=options).result

    assert not result["parameters"]["L"]["identified"]
    assert [one["parameter"] for one in result["diagnosis"]["confounded"]] == ["L"]
    assert "electrical_time_constant" in [one["code"] for one in result["checks"]]
    assert any("L / Ra is" in warning for warning in result["warnings"])
    assert any(warning.startswith("L is") for warning in result["warnings"])

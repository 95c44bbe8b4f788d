"""Electrical time constant or lag of the current sensor: the result reports the confounding."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from bench import EffectRequest, make_campaign
from identification.effects.friction import CoulombFriction
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.model.parameter import Coordinates
from identification.posterior.density import Posterior
from identification.result.omitted import confounded_warnings
from identification.selection.candidates import scales_of
from identification.selection.confounded import confounded_terms
from identification.selection.omitted import OmittedTerm, consider_variances, with_omitted_drawn
from identification.selection.policy import DEFAULT
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.work import metered, operations
from tests.effects.hidden import records_of_bench
from tests.motors import Excitation, campaign, motor_named


@functools.cache
def filtered(motor: str, size: float, rows: int = 1500, training: int = 5) -> tuple[Fit, float]:
    """Fit without the filter of the current that is in the log, and the true inductance [H]."""
    request = EffectRequest("current_filter", size=size)
    hidden = make_campaign(motor, [request], seed=1, rows=rows, training=training)
    fit = fit_declared(records_of_bench(hidden).training, "zoh")
    return fit, hidden.truth["parameters"]["L"]


def interval(fit: Fit, name: str) -> tuple[float, float]:
    """90 % interval of a parameter, including its confounding."""
    posterior = Posterior(fit, effective_fraction(fit))
    draws = with_omitted_drawn(posterior.normal_draws(1), fit, confounded_terms(fit), 1)
    low, high = np.quantile(draws[name], [0.05, 0.95])
    return float(low), float(high)


def is_identified(fit: Fit, name: str) -> bool:
    """True if a parameter is identified in spite of its confounding."""
    variances = consider_variances(fit, confounded_terms(fit))
    return identified(fit, effective_fraction(fit), variances)[name]


@pytest.mark.parametrize(
    ("motor", "size"),
    [("coreless_10w", 0.4), ("ferrite_fan_30w", 0.3), ("wiper_60w", 0.3), ("servo_150w", 1.0)],
)
def test_interval_of_the_inductance_holds_what_a_filter_hides(motor: str, size: float) -> None:
    """A filter of 4, 1.5, 6 or 10 ms is in the log and not in the model, which blames the winding.

    By noise alone the interval of L is narrow and wrong.
    """
    fit, truth = filtered(motor, size)
    narrow = Posterior(fit, effective_fraction(fit)).normal_draws(1)["L"]

    low, high = interval(fit, "L")

    assert not np.quantile(narrow, 0.05) <= truth <= np.quantile(narrow, 0.95)
    assert low <= truth <= high


@pytest.mark.parametrize("motor", ["coreless_10w", "wiper_60w"])
def test_inductance_that_may_be_the_lag_of_a_sensor_is_not_identified(motor: str) -> None:
    """A filter causes nine tenths of the apparent L / Ra: L is not identifiable, with a warning."""
    fit, _ = filtered(motor, 0.4)
    share, terms = effective_fraction(fit), confounded_terms(fit)
    (message,) = [w for w in map(str, confounded_warnings(fit, share, terms)) if w[:4] == "L is"]

    assert identified(fit, share)["L"]
    assert not is_identified(fit, "L")
    assert "confounded with a lag of the current sensor" in message
    assert "the runs fit better with L = " in message
    assert "--known L=VALUE" in message


@pytest.mark.parametrize(
    ("rows", "training", "is_structured"), [(1500, 5, False), (8000, 2, False), (8000, 2, True)]
)
def test_optimum_with_the_lag_in_the_sensor_is_the_true_motor(
    rows: int, training: int, is_structured: bool
) -> None:
    """Truth: a filter of 4 ms and a winding of 0.109 ms; the alternative optimum is these two.

    16,000 samples are fitted to a subset first, and the optimum is then moved to all samples.  If
    the residual has structure, that of the subset is kept.
    """
    fit, truth = filtered("coreless_10w", 0.4, rows, training)
    terms = confounded_terms(fit, is_structured=is_structured)
    term = next(term for term in terms if term.parameter == "L")
    row = fit.coordinates.names.index("L")

    moved = fit.position + np.array([term.steps[name] for name in fit.coordinates.names])

    assert term.name == "current_filter"
    assert term.time == pytest.approx(4e-3, rel=0.02)
    assert fit.coordinates.values(moved)[row] == pytest.approx(truth, rel=0.2)


def test_optimum_of_a_structured_residual_is_fitted_to_the_subset_alone() -> None:
    """All samples say no more than the subset, and a fit to them is several times as much work."""
    fit, _ = filtered("coreless_10w", 0.4, 12_000, 2)
    work = []
    for is_structured in (False, True):
        with metered():
            confounded_terms(fit, is_structured=is_structured)
            work.append(operations())

    assert work[1] < 0.8 * work[0]


@pytest.mark.parametrize("motor", ["coreless 10 W", "servo 100 W", "ferrite 50 W", "pump 2 kW"])
def test_inductance_of_a_resolved_transient_stays_narrow(motor: str) -> None:
    """Speed and current together separate winding and sensor: L is correct within 5 %."""
    chosen = motor_named(motor)
    fit = fit_declared(records_of(campaign(chosen, seed=4)), "zoh")
    truth = dict(zip(fit.coordinates.names, chosen.values, strict=True))["L"]

    low, high = interval(fit, "L")

    assert is_identified(fit, "L")
    assert (high - low) < 0.05 * truth
    assert low <= truth <= high


def test_warning_is_given_beside_parameters_that_were_not_considered() -> None:
    """A curve may get a linear part after the search, of which no change is known: it stays.

    A change of -1 in the logarithm of 2 mH leaves 2 / e.
    """
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")
    term = OmittedTerm("current_filter", 10.0, DEFAULT.exclusion_loss, {"L": -1.0}, "L", 4e-3)

    (message,) = map(str, confounded_warnings(fit, effective_fraction(fit), [term]))

    less = float(message.partition("L = ")[2].split()[0])
    assert less == pytest.approx(2.0 * np.exp(-1.0), rel=0.02)


def test_known_inductance_is_not_confounded_with_a_sensor() -> None:
    """A measured L leaves no lag that a sensor could cause."""
    fit, _ = filtered("coreless_10w", 0.4)
    parameters = [
        replace(p, origin="--known") if p.name == "L" else p for p in fit.coordinates.parameters
    ]
    known = replace(fit, coordinates=Coordinates(parameters))

    assert "L" in [term.parameter for term in confounded_terms(fit)]
    assert "L" not in [term.parameter for term in confounded_terms(known)]


@pytest.mark.parametrize(("kind", "is_open"), [("forward", True), ("steps", False)])
def test_friction_of_one_direction_may_be_a_constant_torque(
    kind: Excitation, *, is_open: bool
) -> None:
    """Terms b w and constant torque are collinear for one sign of the speed, but not for two."""
    chosen = motor_named("servo 100 W")
    fit = fit_declared(records_of(campaign(chosen, seed=4, kind=kind)), "zoh")

    named = [term.name for term in confounded_terms(fit) if term.parameter == "b"]
    low, high = interval(fit, "b")

    assert named == (["coulomb_friction"] if is_open else [])
    assert low <= dict(zip(fit.coordinates.names, chosen.values, strict=True))["b"] <= high


def started_from_rest(torque: float) -> Run:
    """Step of a geared motor with dry friction, which sticks before the step.

    Args:
        torque: Dry friction [N m].
    """
    resistance, constant, inertia, friction, inductance = 2.8, 0.012, 2e-6, 1.5e-6, 2.5e-3
    rows, fine, step = 370, 50, 2e-5
    rng = np.random.default_rng(1)
    voltage = 9.6 * (np.arange(rows) >= 37)
    current, speed, states = 0.0, 0.0, np.empty((rows, 2))
    for k, held in enumerate(voltage):
        states[k] = current, speed
        for _ in range(fine):
            # The winding is exact for a constant speed; the shaft is released at the dry friction.
            final = (held - constant * speed) / resistance
            current = final + (current - final) * np.exp(-step * resistance / inductance)
            driving = constant * current - friction * speed
            speed = max(0.0, speed + step * (driving - torque) / inertia)
    noise = np.array([5e-3, 1.2]) * rng.standard_normal((rows, 2))
    logged, time = states + noise, 1e-3 * np.arange(rows, dtype=np.float64)
    return Run(
        "step.csv", "0" * 64, time, voltage.astype(np.float64), logged[:, 0], logged[:, 1], None
    )


def test_dry_friction_that_holds_the_shaft_at_first_may_be_viscous() -> None:
    """A shaft that creeps at rest and one that sticks are two optima; b of both is in the interval.

    More than half of the friction at full speed is dry, so a model without it has more than twice
    the true b.
    """
    fit = fit_declared(records_of([started_from_rest(1.5e-3)]), "zoh")

    low, high = interval(fit, "b")

    assert dict(zip(fit.coordinates.names, fit.values, strict=True))["b"] > 3e-6
    assert low <= 1.5e-6 <= high
    assert not is_identified(fit, "b")


@pytest.mark.parametrize("direction", ["forward", "both"])
def test_constant_torque_of_one_direction_is_friction_or_load(
    direction: Literal["forward", "both"],
) -> None:
    """Dry friction changes sign with the speed; without a reversal it equals a load."""
    hidden = make_campaign(
        "wiper_60w",
        [EffectRequest("coulomb_friction")],
        seed=14,
        rows=1500,
        direction=direction,
    )
    fit = fit_declared(records_of_bench(hidden).training, "zoh")
    (candidate,) = CoulombFriction.candidates(scales_of(fit))
    start = Start(candidate.starts[:, 0])
    fit = refitted_with(fit, candidate.term, [start])
    found = confounded_warnings(fit, effective_fraction(fit), ())

    assert bool(found) == (direction == "forward")
    assert all("Coulomb friction and a load torque" in warning.message for warning in found)


def test_limit_is_the_quantile_of_one_in_a_thousand() -> None:
    """Half of chi-squared with one degree of freedom at 3.29 standard deviations: 3.29^2 / 2."""
    assert pytest.approx(3.2905**2 / 2, rel=1e-3) == DEFAULT.exclusion_loss

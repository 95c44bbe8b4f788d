"""Laws of the armature circuit cover those of real motors."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import erf

from benchmarks.effects_page import example_scales
from identification.effects.electrical import BrushDrop, InductanceSaturation
from identification.effects.runs import EACH_RUN
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.term import Signals, Values
from identification.selection.search import search
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named

Array = NDArray[np.float64]

TERM = BrushDrop(10.0, 1.0)
NAMES = [parameter.name for parameter in TERM.parameters]


def drop_of(current: Array, *values: float) -> Array:
    """Brush voltage at each current, with the sign of the current [V]."""
    i = ca.SX.sym("i")
    nothing = ca.SX(0)
    signals = Signals(i, *[nothing] * 7)
    own = dict(zip(NAMES, values, strict=True))
    voltage = ca.Function("v", [i], [TERM.voltage(signals, Values(), Values(**own))])
    lost: Array = -np.asarray(voltage(current[None, :]))[0]
    return lost


@pytest.mark.parametrize(
    ("law", "tolerance"),
    [
        (lambda x: x / (1 + np.abs(x)), 1e-6),
        (lambda x: x / np.sqrt(1 + x**2), 1e-6),
        (np.tanh, 1e-3),
        (erf, 1e-3),
        (lambda x: np.sign(x) * -np.expm1(-np.abs(x)), 2e-3),
        (lambda x: np.arctan(np.pi / 2 * x) * 2 / np.pi, 1e-3),
    ],
    ids=["hyperbola", "root", "tanh", "erf", "exponential", "arctan"],
)
def test_knees_of_every_usual_law_are_met(law: Callable[[Any], Any], tolerance: float) -> None:
    """Errors relative to the full drop, from far below to far above the knee."""
    current = np.geomspace(1e-2, 20.0, 150)
    wanted = law(current)

    def error(x: Array) -> Array:
        return np.asarray(drop_of(current, x[0], *np.exp(x[1:]), 0.0) - wanted)

    fitted = least_squares(error, [1.0, 0.0, 0.3, 0.5], x_scale=0.1)

    assert np.abs(fitted.fun).max() < tolerance


@pytest.mark.parametrize("sharpness", [0.6, 2.0, 8.0])
@pytest.mark.parametrize("openness", [0.04, 1.0, 2.5])
def test_near_no_current_brushes_are_a_resistance(sharpness: float, openness: float) -> None:
    """For each shape the drop is odd and continuous where its series takes over."""
    current = np.geomspace(3e-3, 3.0, 4000)

    drop = drop_of(current, 1.0, 1.0, sharpness, openness, 0.0)

    np.testing.assert_allclose(drop_of(-current, 1.0, 1.0, sharpness, openness, 0.0), -drop)
    slope = np.diff(drop) / np.diff(current)
    assert np.all(slope > -1e-9)
    assert np.all(np.diff(slope) < 1e-4)
    assert drop[-1] < 1.0


SERVO = motor_named("servo 100 W")


def _brushed(voltage: Array, temperature: float) -> Array:
    """Current and speed of a servo whose brushes lose 1 V, 0.4 % less for each kelvin [A, rad/s].

    Midpoint rule in steps of 25 us.
    """
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = SERVO.values
    warm = temperature - 25.0
    ra, kt, lost = ra * (1 + alpha_ra * warm), kt * (1 + alpha_kt * warm), 1.0 - 0.004 * warm
    parts, current, speed = 40, 0.0, 0.0
    step = SERVO.interval / parts
    out = np.empty((voltage.size, 2))

    def rates(applied: float, current: float, speed: float) -> tuple[float, float]:
        drop = lost * math.copysign(-math.expm1(-abs(current) / 0.5), current)
        pushed = applied - ra * current - kt * speed - drop
        return pushed / inductance, (kt * current - friction * speed) / inertia

    for k, applied in enumerate(voltage.tolist()):
        out[k] = current, speed
        for _ in range(parts):
            risen, gained = rates(applied, current, speed)
            half = current + 0.5 * step * risen, speed + 0.5 * step * gained
            risen, gained = rates(applied, *half)
            current, speed = current + step * risen, speed + step * gained
    return out


WITHHELD = all_but(
    "brush_drop",
    "flux_saturation",
    "self_heating",
    "winding_lag",
    "magnet_lag",
    "resistance_curvature",
    "demagnetization",
)


def test_a_brush_drop_that_falls_as_it_warms_does_not_bias_the_temperature_coefficients() -> None:
    """Its change with temperature is found with its size; without it, alpha_Kt was off."""
    rng = np.random.default_rng(5)
    runs = []
    for k, temperature in enumerate((25.0, 60.0, 90.0, 45.0)):
        voltage = drive(SERVO, "steps", 1500, rng)
        exact = _brushed(voltage, temperature)
        noisy = exact + 0.002 * exact.std(axis=0) * rng.standard_normal(exact.shape)
        logged = np.round(temperature + 0.1 * rng.standard_normal(voltage.size), 1)
        time = SERVO.interval * np.arange(voltage.size, dtype=np.float64)
        current, speed = noisy.T
        runs.append(Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, logged))
    campaign = campaign_of(runs[:3], runs[3:])

    fit = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD).fit

    assert [term.name for term in fit.simulator.model.terms] == ["brush_drop"]
    values = fit.by_name
    assert values["brush_drop.rate"] == pytest.approx(-0.004, rel=0.2)
    missed = (fit.values[:7] - SERVO.vector) / fit.deviations[:7]
    assert np.abs(missed[[0, 1, 2, 3]]).max() < 3.5


def test_runs_at_one_temperature_offer_no_brush_drop_that_changes_with_it() -> None:
    """Its rate would be unknown; the extension costs a fit."""
    cold, warm = BrushDrop(10.0, 1.0), BrushDrop(10.0, 1.0, is_heated=True)

    assert cold.richer == ()
    assert [term.variant for term in warm.richer] == ["changing with temperature"]
    assert warm.richer[0].richer == ()


def test_a_saturation_is_tried_with_the_inductance_at_the_usual_current_unchanged() -> None:
    """The nominal L is that at the usual current, in each prototype and where its refit starts."""
    scales = example_scales()
    (candidate,) = InductanceSaturation.candidates(scales)
    usual: Any = SimpleNamespace(current=scales.current)

    for values, factors in candidate.traded:
        own = SimpleNamespace(fall=values[0], exponent=values[1], leakage=values[2])
        left = []
        for term in (candidate.term, candidate.final):
            assert isinstance(term, InductanceSaturation)
            left.append(float(term.factor(usual, SimpleNamespace(), own)))
        assert left[0] == pytest.approx(1.0)
        assert factors["L"] * left[1] == pytest.approx(1.0)
        assert factors["L"] > 1.05


def test_a_drop_of_each_run_is_tried_if_there_are_several_runs() -> None:
    """The law with an excess contains the law with one drop, at an excess of zero."""
    single, several = BrushDrop(10.0, 1.0), BrushDrop(10.0, 1.0, several=True)
    (each,) = several.richer

    assert single.richer == ()
    assert (several.variant, each.variant) == ("", EACH_RUN)
    assert [state.name for state in each.states] == ["excess"]
    assert each.richer == ()

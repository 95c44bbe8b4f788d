"""Dry friction that holds a shaft at rest does not bias the parameters of long runs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.benches.excitation import speeds
from benchmarks.benches.motors import BenchMotor, drawn_motor
from benchmarks.benches.plant import Drive, Hidden, Trajectory, simulated
from identification.effects.friction import CoulombFriction
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits, solve
from identification.ingest.run import Run
from identification.quantities import DECLARED_PARAMETERS
from identification.selection.candidates import scales_of
from identification.selection.outcome import Outcome
from identification.selection.refit import refined, refitted_with, refitted_without
from identification.selection.sharp_rivals import with_sharp_signs
from identification.selection.sharpening import sharpened, with_sharp_friction
from identification.selection.start import Start
from identification.selection.steps import State
from identification.selection.trials import Trials

Array = NDArray[np.float64]

ROWS = 12_000
INTERVAL = 1e-3
TEMPERATURES = (30.0, 80.0)


def _motor() -> BenchMotor:
    return drawn_motor(np.random.default_rng(7))


def _trajectories(friction: float) -> list[tuple[Array, Array, Trajectory]]:
    """Time, temperature and exact signals of runs under speed control, which begin at rest.

    Args:
        friction: Set-valued Coulomb friction over the rated torque [-].
    """
    motor, rng = _motor(), np.random.default_rng(11)
    time = INTERVAL * np.arange(ROWS, dtype=np.float64)
    gain = 0.5 * motor.Kt25
    drive = Drive(
        1.2 * motor.rated_voltage,
        proportional=gain,
        integral=0.5 * gain / motor.mechanical_time_constant,
    )
    found = []
    for ambient in TEMPERATURES:
        body = ambient + 5.0 * time / time[-1]
        seen = 0.003 * motor.rated_speed * rng.standard_normal(ROWS)
        hidden = Hidden(dry=friction * motor.rated_torque)
        wanted = speeds(motor, time, rng)
        wanted[: ROWS // 20] = 0.0
        found.append((time, body, simulated(motor, hidden, drive, time, wanted, body, seen, 0.0)))
    return found


def _campaign(friction: float, sign: float) -> Campaign:
    """Campaign of the logged runs.

    Args:
        friction: As in `_trajectories`.
        sign: 1 or -1, factor on the noise of the sensors.
    """
    motor, rng = _motor(), np.random.default_rng(13)
    runs = []
    for k, (time, body, true) in enumerate(_trajectories(friction)):
        noise = sign * rng.standard_normal((2, ROWS))
        current = true.current + 0.004 * motor.rated_current * noise[0]
        speed = true.speed + 0.003 * motor.rated_speed * noise[1]
        runs.append(Run(f"{k}.csv", f"{k:064d}", time, true.command, current, speed, body))
    return campaign_of(runs, ())


def _fitted(friction: float, sign: float) -> Fit:
    """Fit of the nominal model with Coulomb friction; arguments as of `_campaign`."""
    declared = fit_declared(_campaign(friction, sign).training, "zoh")
    (candidate,) = CoulombFriction.candidates(scales_of(declared))
    start = Start(candidate.starts[:, 0])
    return refined(refitted_with(declared, candidate.term, [start], TerminationLimits(40)))


@cache
def _pair(friction: float) -> tuple[tuple[Fit, Fit], tuple[Fit, Fit]]:
    """Fits to noise and to its mirror image, before and after sharpening."""
    before = _fitted(friction, 1.0), _fitted(friction, -1.0)
    return before, (sharpened(before[0]), sharpened(before[1]))


def _bias(fits: tuple[Fit, Fit]) -> Array:
    """(7,) mean error of two fits, in which noise and mirror image cancel [sd]."""
    motor = _motor()
    true = np.array([getattr(motor, name) for name in DECLARED_PARAMETERS])
    error = np.mean([fit.values[: true.size] - true for fit in fits], axis=0)
    return np.asarray(error / fits[0].deviations[: true.size])


def test_dry_friction_at_rest_does_not_bias_the_motor() -> None:
    """A smoothed sign creeps where a real shaft rests; a sharper one leaves a tenth of the bias."""
    before, after = _pair(0.06)

    assert np.abs(_bias(before)).max() > 0.5
    assert np.abs(_bias(after)).max() < 0.25


def test_a_sharper_sign_adds_no_information() -> None:
    """Standard deviations stay the same, and the likelihood rises."""
    before, after = _pair(0.06)

    for smooth, sharp in zip(before, after, strict=True):
        assert sharp.cost < smooth.cost
        assert sharp.converged
        assert sharp.deviations / smooth.deviations == pytest.approx(1.0, abs=0.1)


def test_terms_that_imitate_the_creep_widen_no_interval() -> None:
    """The motor has Coulomb friction alone; the creep of the smoothed one is a load torque."""
    campaign, ((before, _), _) = _campaign(0.06, 1.0), _pair(0.06)
    trials = Trials(campaign)
    omitted = trials.omitted(trials.evaluate(before))
    outcome = with_sharp_friction(Outcome(before, (), (), omitted=omitted), campaign)

    assert omitted
    assert outcome.smooth is before.simulator.model
    assert not outcome.omitted


@pytest.mark.parametrize("size", [4.0, 8.0])
def test_an_outlying_first_speed_does_not_stop_the_fit(size: float) -> None:
    """Friction erases the initial speed, so that the fit cannot step to it at once."""
    (before, _), (after, _) = _pair(0.06)
    records = []
    for record in after.simulator.records:
        measured = record.measured.copy()
        measured[0, 1] += size * after.weighting.deviation[1]
        records.append(replace(record, measured=measured))
    simulator = replace(after.simulator, records=tuple(records))
    weighting = replace(after.weighting, records=tuple(records))
    at_rest = [np.zeros(2) for _ in records]

    fit = solve(simulator, before.coordinates, before.position, at_rest, weighting)

    assert fit.converged
    assert np.abs((fit.values - after.values) / after.deviations).max() < 1.0


def test_a_motor_without_friction_is_not_refitted() -> None:
    """The nominal model is integrated exactly and has nothing to sharpen."""
    (time, body, true), *_ = _trajectories(0.0)
    run = Run("0.csv", "0" * 64, time, true.command, true.current, true.speed, body)
    fit = fit_declared(campaign_of([run], ()).training, "zoh")

    assert sharpened(fit) is fit


@pytest.mark.parametrize(("behind", "is_sharp"), [(1.0, True), (1000.0, False)])
def test_close_rivals_are_compared_with_a_sharp_sign(*, behind: float, is_sharp: bool) -> None:
    """A sharper sign gains less than a thousand in log likelihood, and costs a fit."""
    (before, _), (after, _) = _pair(0.06)
    trials = Trials(_campaign(0.06, 1.0))
    current = trials.evaluate(before)
    bare = refitted_without(before, "coulomb_friction", TerminationLimits(0))
    rival = replace(current, fit=replace(bare, cost=current.fit.cost + behind))

    compared = with_sharp_signs(State(trials, current, current), [current, rival])

    assert compared[0].fit.cost == pytest.approx(after.cost if is_sharp else before.cost, abs=0.1)
    assert compared[1] is rival

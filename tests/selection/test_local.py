"""Effects of single runs or of a time span act only there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification import FitOptions, identify
from identification.effects.effect import AbstractEffect
from identification.effects.inertia import InertiaChange
from identification.effects.load import LoadStep
from identification.fit.declared import fit_declared
from identification.fit.evaluate import Simulated
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from identification.prediction import predict
from identification.result.simulation_errors import worse_warnings
from identification.selection.candidates import scales_of, without_shared
from identification.selection.projection import Projection
from identification.selection.screen import screened
from identification.selection.start import Along
from identification.speed_loop.closed_loop import acting_terms
from identification.surrogates.curve import HEIGHTS
from identification.surrogates.curves import MissingTorque
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]

MOTOR = motor_named("servo 100 W")
TORQUE = 0.1
STEP = LoadStep(0, 1.0, 2e-3, 0.8, others=(2,))
VALUES = np.array([*MOTOR.vector, TORQUE, 0.2, 0.5])
CURVE = MissingTorque("time", "", 1.0, 0.0, 2.4, 1.0, 1.0, 1.0, (0.0, 0.8, 1.6, 2.4))


def _logged(runs: list[Run], values: Array, *terms: AbstractTerm, first: int = 0) -> list[Array]:
    """Current and speed of each run from the same initial state."""
    records = records_of(runs, first)
    model = MotorModel(terms)
    states = [initial_states(model, record) for record in records]
    simulator = Simulator.fitting(model, records, values)
    return [y[:, :, 0] for y in simulator.logged(values[:, None], states)]


def _loaded_in_first_and_third(runs: list[Run]) -> list[Run]:
    """The runs with the load step, with new noise of 1 %."""
    rng = np.random.default_rng(8)
    made = []
    for run, y in zip(runs, _logged(runs, VALUES, STEP), strict=True):
        current, speed = (y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)).T
        made.append(
            Run(run.name, run.sha256, run.time, run.voltage, current, speed, run.temperature)
        )
    return made


def test_a_load_that_recurs_at_a_time_is_of_those_runs_and_of_no_other() -> None:
    """Loaded are runs 1 and 3 of three from 0.2 to 0.5 s; the fourth, for validation, is not.

    Expected of the fourth is what the motor does without a load, whose noise is one per cent.
    """
    runs = _loaded_in_first_and_third(campaign(MOTOR, seed=7, runs=4, rows=800))
    runs = [
        Run(r.name, f"{k:064d}", r.time, r.voltage, r.current, r.speed, r.temperature)
        for k, r in enumerate(runs)
    ]

    identification = identify(runs[:3], runs[3:], FitOptions(posterior=False))
    result: Any = identification.result

    assert [effect["name"] for effect in result["effects"]] == ["load_step"]
    (effect,) = result["effects"]
    assert effect["variant"] == "runs 1 and 3"
    found = {name: entry["estimate"] for name, entry in effect["parameters"].items()}
    assert found == pytest.approx({"torque": TORQUE, "start": 0.2, "stop": 0.5}, rel=0.03)
    errors = result["errors"]["after"]["validation"]
    assert all(entry["noise_ratio"] < 1.2 for entry in errors.values())
    predicted = predict(result, runs[3])
    error = predicted["speed_rad_s"] - runs[3].speed
    assert np.sqrt(np.mean(error**2)) < 0.012 * runs[3].speed.std()


def test_a_changed_inertia_in_the_longest_run_is_of_that_run() -> None:
    """Run 2 of three has 1.9 times the inertia and five times the samples of the others.

    The fitted J is nearly that of run 2, so a change of run 1 or 3 gains much as well: the median
    of the two is about half of the gain of run 2.
    """
    values = (*MOTOR.values[:4], 1.9 * MOTOR.values[4], *MOTOR.values[5:])
    disc = replace(MOTOR, values=values)
    first, last = campaign(MOTOR, seed=7, runs=2, rows=400)
    (middle,) = campaign(disc, seed=9, runs=1, rows=2000)
    fit = fit_declared(records_of([first, middle, last]), "zoh")

    of_some_runs = [c for c in InertiaChange.candidates(scales_of(fit)) if c.by_run]
    scores = screened(fit, of_some_runs)

    best = {s.candidate.term.runs: s.gain for s in reversed(scores) if s.candidate.term.runs}
    assert np.median([best[(0,)], best[(2,)]]) > best[(1,)] / 4
    assert {s.candidate.term.runs for s in without_shared(scores)} == {(1,)}


def test_a_disk_on_the_shaft_in_some_runs_is_a_change_of_inertia_in_those_runs() -> None:
    """Runs 2 and 4 of five have 3.4 times the inertia, and of two for validation the second.

    Which of these has the disk is seen in its samples alone, and said.
    """
    share = 3.4
    values = (*MOTOR.values[:4], share * MOTOR.values[4], *MOTOR.values[5:])
    plain = campaign(MOTOR, seed=7, runs=4, rows=800)
    disk = campaign(replace(MOTOR, values=values), seed=9, runs=3, rows=800)
    runs = [plain[0], disk[0], plain[1], disk[1], plain[2], plain[3], disk[2]]
    named = [replace(run, name=f"{k}.csv", sha256=f"{k:064d}") for k, run in enumerate(runs)]

    result: Any = identify(named[:5], named[5:], FitOptions(posterior=False)).result

    (effect,) = result["effects"]
    assert effect["name"] == "inertia_change"
    change = 1.0 + effect["parameters"]["change"]["estimate"]
    inertia = result["parameters"]["J"]["estimate"]
    if effect["variant"] == "runs 2 and 4":
        without, with_disk = inertia, change * inertia
    else:
        assert effect["variant"] == "runs 1, 3 and 5"
        without, with_disk = change * inertia, inertia
    assert without == pytest.approx(MOTOR.values[4], rel=0.02)
    assert with_disk == pytest.approx(share * MOTOR.values[4], rel=0.02)
    errors = result["errors"]["after"]["validation"]
    assert all(entry["noise_ratio"] < 1.2 for entry in errors.values())
    codes = [detail["code"] for detail in result["warning_details"]]
    said = result["warnings"][codes.index("change_in_validation")]
    assert said.startswith("6.csv" if effect["variant"] == "runs 2 and 4" else "5.csv")


def test_given_the_true_change_other_runs_gain_nothing() -> None:
    """Closed form: a coefficient x of runs with information I_k, its common value fitted.

    A change d in run 1 leaves I_k (d_k1 - I_1 / I) d, with sum I, and the deviations of runs have
    the inner products I_k d_kl - I_k I_l / I.  Given run 1, the others gain nothing; given a change
    of run 0, run 1 keeps its amplitude d and so its whole gain.  Changes of one of two runs are
    collinear.
    """
    information, change = np.array([1.0, 20.0, 2.0]), 3.0
    products = np.diag(information) - np.outer(information, information) / information.sum()
    along = Along(np.zeros((0, 3)), ())
    projection = Projection(products[:, 1] * change, products, along)

    np.testing.assert_allclose(projection.conditional_gains([1])[[0, 2]], 0.0, atol=1e-12)
    alone = 0.5 * products[1, 1] * change**2
    assert projection.conditional_gains([0])[1] == pytest.approx(alone)

    two = np.array([[1.0, -1.0], [-1.0, 1.0]])
    pair = Projection(change * two[:, 1], two, Along(np.zeros((0, 2)), ()))
    np.testing.assert_allclose(pair.conditional_gains([0]), pair.conditional_gains([1]))
    assert pair.conditional_gains([0])[1] == pytest.approx(0.5 * change**2)


@pytest.mark.parametrize(
    ("term", "values"), [(STEP, VALUES[7:]), (CURVE, np.full(HEIGHTS, TORQUE))]
)
def test_what_belongs_to_training_runs_leaves_other_runs_and_the_loop_alone(
    term: AbstractEffect, values: Array
) -> None:
    """The same bytes as run 1 differ from the nominal model, as run 4 they do not."""
    runs = campaign(MOTOR, seed=7, runs=1, rows=800)
    own = np.concatenate([MOTOR.vector, values])

    (nominal,) = _logged(runs, MOTOR.vector)
    (here,) = _logged(runs, own, term, first=0)
    (elsewhere,) = _logged(runs, own, term, first=3)

    assert term.is_local
    assert np.abs(here - nominal).max() > 0.1
    np.testing.assert_allclose(elsewhere, nominal, rtol=1e-6, atol=1e-6)
    assert acting_terms(MotorModel((term,))) == ()


def test_a_coefficient_that_drifted_is_kept_by_later_runs() -> None:
    """Friction that has fallen by running-in stays so in all later runs."""
    worn = MissingTorque("time", "direction", 1.0, 0.0, 2.4, 1.0, 1.0, 1.0, (0.0, 0.8, 1.6, 2.4))
    runs = campaign(MOTOR, seed=7, runs=1, rows=800)
    own = np.concatenate([MOTOR.vector, np.full(HEIGHTS, TORQUE)])

    (here,) = _logged(runs, own, worn, first=2)
    (later,) = _logged(runs, own, worn, first=3)

    assert not worn.is_local
    np.testing.assert_allclose(later, here, rtol=1e-6, atol=1e-6)


def test_a_run_that_effects_predict_worse_is_named_with_what_to_do() -> None:
    """Errors of 3 and 1 times the noise, and the reverse."""
    (record,) = records_of(campaign(MOTOR, seed=7, runs=1, rows=800))
    noise = np.array([0.1, 1.0])
    close = Simulated(record, record.measured + noise, np.zeros(2))
    far = Simulated(record, record.measured + 3.0 * noise, np.zeros(2))

    (current, speed) = worse_warnings([close], [far], noise, ["load_step"])

    assert current.code == "effects_predict_worse"
    assert current.message.startswith("effects_predict_worse: run0.csv: with load_step")
    assert (
        "the current is 3 times the sensor noise, with the nominal model 1 times" in current.message
    )
    assert "--declared" in speed.fix
    assert worse_warnings([far], [close], noise, ["load_step"]) == []

    unstable = Simulated(record, np.full_like(record.measured, np.nan), np.zeros(2))
    (current, _) = worse_warnings([close], [unstable], noise, ["load_step"])
    assert "with load_step the simulation of the current diverges" in current.message
    assert worse_warnings([unstable], [close], noise, ["load_step"]) == []
    assert worse_warnings([close], [close], noise, ["load_step"]) == []

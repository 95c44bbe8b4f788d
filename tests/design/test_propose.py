"""Proposed runs: limits, expected widths, comparison with a binary signal, separation."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import EffectRequest, make_campaign
from benchmarks.coverage import run_of as recorded
from identification import FitOptions, Run, identify
from identification.design import (
    DesignOptions,
    Proposal,
    profile_csv,
    proposal_entry,
    propose,
    task_of_nameplate,
    task_of_result,
)
from identification.design.criteria import information_bits, narrowed
from identification.design.profiles import prbs
from identification.design.propose import Designer
from identification.effects.catalogue import CATALOGUE
from identification.errors import InputError, OptionError
from identification.ingest import read_run
from tests.motors import NAMES, campaign, motor_named, run_of, simulated

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")
PAIR = ("coulomb_friction", "load_torque")
LIMITS = "current=3,speed=150,slew=4000,position=40"


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    """Two short runs of a servo at 25 and 115 degC."""
    return campaign(SERVO, seed=5, runs=2, rows=400)


@pytest.fixture(scope="module")
def result(runs: list[Run]) -> dict[str, Any]:
    """Nominal model fitted to these runs."""
    return identify(runs, [], FitOptions(posterior=False, effects=False)).result


@pytest.fixture(scope="module")
def proposal(result: dict[str, Any]) -> Proposal:
    """Run of 400 samples at 60 degC that narrows the inertia."""
    options = DesignOptions(duration=400 * SERVO.interval, temperatures=(60.0,), narrow="J")
    return propose(task_of_result(result, options))


def played(voltage: Array, temperature: float, noise: dict[str, float]) -> Run:
    """The voltage on the true servo, with this noise."""
    clean = run_of(SERVO, voltage, np.full(voltage.size, temperature), np.zeros(2), name="n.csv")
    return noisy(clean, noise)


def noisy(clean: Run, noise: dict[str, float]) -> Run:
    """The run with this noise."""
    rng = np.random.default_rng(8)
    return replace(
        clean,
        sha256="f" * 64,
        current=clean.current + noise["current_A"] * rng.standard_normal(clean.rows),
        speed=clean.speed + noise["speed_rad_s"] * rng.standard_normal(clean.rows),
    )


def loaded(voltage: Array, load: Array) -> Run:
    """The voltage on the true servo at 25 degC under a load that is constant in spans.

    A load T acts as a voltage of -Ra T / Kt on a motor whose current is less by T / Kt.
    """
    warm = np.full(voltage.size, 25.0)
    clean = run_of(SERVO, voltage, warm, np.zeros(2), name="n.csv")
    value = dict(zip(NAMES, SERVO.vector, strict=True))
    edges = [0, *(np.flatnonzero(np.diff(load)) + 1), load.size - 1]
    for first, last in pairwise(edges):
        shift = np.array([load[first] / value["Kt25"], 0.0])
        start = np.array([clean.current[first], clean.speed[first]]) - shift
        span = slice(first, last + 1)
        felt = voltage[span] - value["Ra25"] * shift[0]
        found = simulated(SERVO.vector, SERVO.interval, felt, warm[span], start) + shift
        clean.current[span], clean.speed[span] = found.T
    return clean


def test_fit_with_the_proposed_run_reaches_the_expected_width(
    runs: list[Run], result: dict[str, Any], proposal: Proposal
) -> None:
    """The interval comes from a fit to all three runs; its noise is itself an estimate."""
    expected = proposal_entry(proposal)["narrow"]
    new = played(proposal.best.voltage, 60.0, result["noise"])
    options = FitOptions(posterior=False, effects=False)
    after = identify([*runs, new], [], options).result["parameters"]["J"]

    width = after["q95"] - after["q05"]

    assert expected["width_after"] < 0.9 * expected["width_before"]
    assert width == pytest.approx(expected["width_after"], rel=0.15)


def test_proposed_run_holds_at_least_the_information_of_a_binary_signal(
    result: dict[str, Any],
) -> None:
    """Binary signals of twelve clocks within the same limits, none of them a candidate."""
    task = task_of_result(result, DesignOptions(temperatures=(60.0,)))
    designer = Designer(task)
    best = propose(task)

    bits = []
    for clock in np.geomspace(3.0 * task.interval, task.duration / 8.0, 12):
        profile = prbs(task.duration, float(clock), np.random.default_rng(77))
        one = designer.candidate(profile, 60.0)
        assert one is not None
        bits.append(information_bits(task.models[0].covariance, one.responses[0].information))

    assert best.bits[0] >= max(bits)


def test_every_draw_of_the_motor_holds_the_limits(result: dict[str, Any]) -> None:
    """Each of 200 draws simulated by the exact discretisation of the tests."""
    task = task_of_result(result, DesignOptions(limits=(LIMITS,), temperatures=(25.0,)))

    best = propose(task)

    voltage = best.best.voltage
    warm = np.full(voltage.size, 25.0)
    for values in task.models[0].draws(200, task.seed).T:
        current, speed = simulated(values, task.interval, voltage, warm, np.zeros(2)).T
        angle = np.cumsum(speed) * task.interval
        assert np.abs(current).max() <= 3.0 * 1.001
        assert np.abs(speed).max() <= 150.0 * 1.001
        assert np.abs(angle).max() <= 40.0 * 1.001
    assert np.abs(np.diff(voltage)).max() <= 4000.0 * task.interval * 1.001
    assert voltage[-1] == 0.0


def test_limits_hold_between_the_samples(result: dict[str, Any]) -> None:
    """At 10 ms the electrical time constant is short: the current peaks before the next sample."""
    options = DesignOptions(limits=("current=3",), temperatures=(25.0,), rate=100.0, duration=4.0)
    task = task_of_result(result, options)
    designer = Designer(task)
    shape = np.where(np.arange(task.rows) // 40 % 2 == 0, 1.0, -1.0)
    draws = designer.draws(4)

    voltage = designer.within(draws, shape, 25.0, 0.0, is_final=True)

    assert voltage is not None
    fine = np.repeat(voltage, 50)
    found = [
        simulated(one, task.interval / 50, fine, np.full(fine.size, 25.0), np.zeros(2))[:, 0]
        for one in draws[0].T
    ]
    assert 0.97 * 3.0 < np.abs(found).max() <= 3.0
    assert np.abs([one[::50] for one in found]).max() < 2.9


def test_a_diverging_draw_does_not_hold_the_limits(result: dict[str, Any]) -> None:
    """A torque constant of 1e200 overflows the simulation of that draw."""
    task = task_of_result(result, DesignOptions(temperatures=(25.0,)))
    designer = Designer(task)
    draws = designer.draws(2)
    draws[0][NAMES.index("Kt25"), 1] = 1e200
    with np.errstate(all="ignore"):
        assert designer.within(draws, np.ones(task.rows), 25.0, 0.0) is None


def test_proposal_is_a_run_file_and_equal_seeds_give_equal_files(
    result: dict[str, Any], tmp_path: Path
) -> None:
    """The reader takes time and temperature of the file once current and speed are added."""
    task = task_of_result(result, DesignOptions(duration=0.2, seed=3))

    text = profile_csv(propose(task))

    assert profile_csv(propose(task)) == text
    header, *rows = text.splitlines()
    file = tmp_path / "played.csv"
    lines = [f"{header},current_A,speed_rad_s"]
    lines += [f"{row},{0.1 * (k % 7)},{k % 5}" for k, row in enumerate(rows)]
    file.write_text("\n".join(lines), encoding="utf-8")
    run = read_run(file)
    assert run.rows == task.rows
    assert run.time[1] == pytest.approx(task.interval)
    assert run.voltage[-1] == 0.0


def test_proposed_run_separates_effects_that_one_direction_cannot() -> None:
    """Forward only, a load torque explains Coulomb friction; the other direction shows which."""
    settings: dict[str, Any] = {
        "seed": 3, "rows": 400, "validation": 0, "temperature_span": (25, 26),
        "temperature_motion": 0.5,
    }  # fmt: skip
    effects = [EffectRequest(PAIR[0])]
    measured = make_campaign("servo_150w", effects, training=2, direction="forward", **settings)
    first = [recorded(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    others = [kind for kind in CATALOGUE if kind not in PAIR]
    tied = identify(first, [], FitOptions(posterior=False), withheld=others).result

    best = propose(task_of_result(tied, DesignOptions()))

    assert {model["name"] or PAIR[0] for model in tied["models"]} == set(PAIR)
    assert best.separation is not None
    assert best.separation.least_bits > 0.99
    assert best.best.voltage.min() < 0.0 < best.best.voltage.max()


def test_a_load_turns_the_motor_by_the_speed_that_its_friction_and_back_emf_balance(
    result: dict[str, Any],
) -> None:
    """At zero voltage -T = (b + Kt^2 / Ra) w, and the current brakes with -Kt w / Ra."""
    task = task_of_result(result, DesignOptions(limits=("load=0.02",), temperatures=(25.0,)))
    designer = Designer(task)
    value = dict(zip(task.models[0].names, task.models[0].estimate, strict=True))
    slope = value["b"] + value["Kt25"] ** 2 / value["Ra25"]

    (predictor,) = designer.predictors
    still = np.zeros(task.rows)
    states = predictor.states(still, 25.0, task.models[0].estimate[:, None], 0.02)[:, :, 0]

    current, speed = states[task.rows // 2]
    assert speed == pytest.approx(-0.02 / slope, rel=0.01)
    assert current == pytest.approx(-value["Kt25"] * speed / value["Ra25"], rel=0.01)
    assert np.abs(states[1]).max() < 0.01 * abs(speed)


def test_fit_finds_the_load_of_a_run_and_reaches_the_expected_width(
    runs: list[Run], result: dict[str, Any], proposal: Proposal
) -> None:
    """The load is in no column that the fit reads; it is named as `load_step`."""
    options = DesignOptions(
        limits=("load=0.05",), duration=400 * SERVO.interval, temperatures=(25.0,), narrow="Ra25"
    )
    task = task_of_result(result, options)
    one = Designer(task).candidate(proposal.best.profile, 25.0, 0.05)
    assert one is not None
    assert task.quantity is not None
    model = task.models[0]
    expected = task.quantity.width(narrowed(model.covariance, one.responses[0].information))
    rows = profile_csv(replace(proposal, task=task, best=one)).splitlines()
    load = np.array([float(row.split(",")[3]) for row in rows[1:]])
    new = noisy(loaded(one.voltage, load), result["noise"])

    others = [kind for kind in CATALOGUE if kind != "load_step"]
    after = identify([*runs, new], [], FitOptions(posterior=False), withheld=others).result

    assert rows[0] == "time_s,voltage_V,temperature_degC,load_Nm"
    assert load[0] == load[-1] == 0.0
    assert load.max() == pytest.approx(0.05, rel=0.01)
    assert [effect["name"] for effect in after["effects"]] == ["load_step"]
    entry = after["parameters"]["Ra25"]
    assert entry["q95"] - entry["q05"] == pytest.approx(expected, rel=0.15)


def test_a_load_is_proposed_where_it_narrows_more_than_any_voltage() -> None:
    """Dry friction and b are confounded unless the shaft turns at other speeds at equal voltage."""
    settings: dict[str, Any] = {"seed": 3, "rows": 400, "training": 2, "validation": 0}
    measured = make_campaign("servo_150w", [EffectRequest(PAIR[0])], **settings)
    first = [recorded(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    others = [kind for kind in CATALOGUE if kind not in PAIR]
    known = identify(first, [], FitOptions(posterior=False), withheld=others).result
    limit = f"load={measured.motor.rated_torque}"

    alone, braked = (
        propose(task_of_result(known, DesignOptions(limits, temperatures=(25.0,), narrow="b")))
        for limits in ((), (limit,))
    )

    assert alone.best.load == 0.0
    assert braked.best.load != 0.0
    assert braked.best.score > alone.best.score


def test_first_run_of_a_nameplate_stays_below_its_stall_current() -> None:
    """12 V over 4 A give 3 ohm; a reversal at full voltage would draw twice the stall current."""
    best = propose(
        task_of_nameplate(
            "voltage=12,no_load_speed=3000rpm,stall_current=4", DesignOptions(narrow="Ra25")
        )
    )

    entry = proposal_entry(best)
    assert entry["narrow"]["value"] == pytest.approx(3.0)
    assert entry["narrow"]["width_after"] < 0.1 * entry["narrow"]["width_before"]
    assert entry["predicted_peaks"]["current"] <= 4.0


def test_a_metric_of_the_loop_narrows_as_its_parameters_do(result: dict[str, Any]) -> None:
    """In steady state the loop P:1 reaches K / (1 + K) with the gain K of the motor."""
    options = DesignOptions(temperatures=(25.0, 60.0), narrow="steady_state@25")

    best = propose(task_of_result(result, options))

    entry = proposal_entry(best)["narrow"]
    known = next(e for e in result["feedback"] if e["temperature_degC"] == 25.0)["steady_state"]
    assert entry["value"] == pytest.approx(known["median"], rel=0.01)
    assert entry["width_before"] == pytest.approx(known["q95"] - known["q05"], rel=0.1)
    assert entry["width_after"] < entry["width_before"]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"limits": ("current=0",)}, "positive"),
        ({"limits": ("torque=3",)}, "torque"),
        ({"duration": -1.0}, "duration"),
        ({"rate": float("nan")}, "rate"),
        ({"temperatures": (-300.0,)}, "temperature"),
    ],
)
def test_impossible_options_are_named(options: dict[str, Any], word: str) -> None:
    """Each has one value outside of its range."""
    with pytest.raises(OptionError, match=word):
        DesignOptions(**options)


@pytest.mark.parametrize("member", ["models", "runs", "noise"])
def test_result_without_what_a_design_needs_asks_for_a_new_fit(
    result: dict[str, Any], member: str
) -> None:
    """Results of earlier versions have no covariance of the alternatives."""
    old = {name: value for name, value in result.items() if name != member}

    with pytest.raises(InputError, match="repeat the fit"):
        task_of_result(old, DesignOptions())


def test_damaged_covariance_is_refused(result: dict[str, Any]) -> None:
    """A covariance without its last row fits no parameters."""
    (model,) = result["models"]
    damaged = result | {"models": [model | {"covariance": model["covariance"][:-1]}]}

    with pytest.raises(InputError, match="models"):
        task_of_result(damaged, DesignOptions())

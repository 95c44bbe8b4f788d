"""Partial pooling over the motors of a type."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from identification import FitOptions, Run, identify
from identification.fleet.page import render_fleet
from identification.fleet.pooling import Pool, pools_of
from identification.fleet.refit import Refit, Size, refit_of
from identification.fleet.table import POOLED_COLUMNS, csv_text, pooled_rows, rows_of
from tests.fleet.fleets import CENTRE, estimate, fleet
from tests.motors import Motor, campaign, drive, motor_named, run_of

EFFECT = "coulomb_friction"


def measured(alphas: list[float], sd: float = 2e-4, kind: str = "") -> list[Refit]:
    """Motors whose runs determine alpha_Ra with the same standard deviation [1/K]."""
    return [
        Refit(f"{kind}{n}", "fitted", {"alpha_Ra": estimate(alpha, sd)}, type=kind)
        for n, alpha in enumerate(alphas)
    ]


def pool_of(refits: list[Refit], name: str = "alpha_Ra") -> Pool:
    """The only pool of this quantity."""
    (pool,) = [pool for pool in pools_of(refits) if pool.name == name]
    return pool


def test_motors_are_pooled_with_their_own_type_only() -> None:
    """Two types at 3.9e-3 and 3.3e-3 per kelvin have two means; each keeps within its own."""
    rng = np.random.default_rng(0)
    refits = [
        *measured([*(3.9e-3 + 1e-4 * rng.normal(size=8))], kind="A"),
        *measured([*(3.3e-3 + 1e-4 * rng.normal(size=8))], kind="B"),
    ]

    first, second = pools_of(refits)

    assert (first.type, second.type) == ("A", "B")
    assert first.mean[1] == pytest.approx(3.9e-3, abs=2e-4)
    assert second.mean[1] == pytest.approx(3.3e-3, abs=2e-4)
    assert [*first.motors] == [*range(8)]
    assert [*second.motors] == [*range(8, 16)]


def test_foreign_motor_is_left_out_and_does_not_move_the_type() -> None:
    """A motor with half the coefficient of the others changes the mean by nothing."""
    rng = np.random.default_rng(1)
    alphas = [*(3.9e-3 + 1e-4 * rng.normal(size=9))]

    alone, joined = pool_of(measured(alphas)), pool_of(measured([*alphas, 1.9e-3]))

    assert joined.left_out == (9,)
    assert 9 not in joined.motors
    assert joined.mean == pytest.approx(alone.mean)


def test_motor_whose_runs_do_not_determine_the_coefficient_gets_that_of_its_type() -> None:
    """Its own wide interval of the prior has no weight; the pooled one is the type's."""
    unknown = Refit(
        "cold", "fitted", {"alpha_Ra": estimate(7e-3, 2e-3, is_identified=False)}
    )  # fmt: skip
    pool = pool_of([*measured([3.8e-3, 3.9e-3, 3.85e-3, 3.95e-3]), unknown])
    low, median, high = pool.motors[4]

    assert median == pytest.approx(3.875e-3, abs=5e-5)
    assert high - low < 0.5 * 3.29 * 2e-3
    assert pool.count == 4


def test_two_motors_are_not_pooled() -> None:
    """Two values hardly determine the spread of a type."""
    assert pools_of(measured([3.8e-3, 3.9e-3])) == []


def test_sizes_of_an_effect_are_pooled_as_logarithms_where_it_was_found() -> None:
    """Four of six motors have friction; the type mean is the geometric mean of 1, 2, 4, 8 mN m."""
    refits = [
        dataclasses.replace(refit, sizes={f"{EFFECT}.torque": Size(estimate(t, 1e-5), "N m", "")})
        if t
        else refit
        for refit, t in zip(fleet(6), [1e-3, 2e-3, 0.0, 4e-3, 0.0, 8e-3], strict=True)
    ]

    pool = pool_of(refits, f"{EFFECT}.torque")

    assert [*pool.motors] == [0, 1, 3, 5]
    assert pool.is_relative
    assert pool.mean[1] == pytest.approx((1 * 2 * 4 * 8) ** 0.25 * 1e-3, rel=0.02)


def test_sizes_with_different_definitions_are_not_pooled() -> None:
    """A drag at 100 rad/s and a drag at 200 rad/s are different quantities."""
    refits = [
        dataclasses.replace(
            refit, sizes={"quadratic_drag.torque": Size(estimate(1e-3, 1e-5), "N m", f"at {n}")}
        )
        for n, refit in enumerate(fleet(6))
    ]

    assert {pool.name for pool in pools_of(refits)} == {"alpha_Ra", "alpha_Kt"}


def test_size_of_an_effect_is_its_first_parameter_with_its_definition() -> None:
    """result.json lists the size first; effects of single runs are no properties of the motor."""
    entry = {"median": 2.0, "sd": 0.1, "q05": 1.8, "q95": 2.2, "unit": "V", "identified": True}
    result = {
        "effects": [
            {"name": "load_step", "parameters": {"torque": entry}},
            {
                "name": "brush_drop",
                "variant": "x",
                "parameters": {"voltage": entry | {"meaning": "both brushes"}, "knee": entry},
            },
        ]
    }

    sizes = refit_of("m", "fitted", result).sizes

    assert list(sizes) == ["brush_drop.voltage"]
    assert sizes["brush_drop.voltage"].estimate.median == 2.0
    assert sizes["brush_drop.voltage"].meaning == "both brushes x"


def test_tables_have_the_own_and_the_pooled_interval() -> None:
    """The own columns are unchanged, the pooled ones are those of the pool, in both tables."""
    refits = fleet(8, 3)
    pool = pool_of(refits)

    row = rows_of(refits)[2]
    (long,) = [
        one
        for one in pooled_rows(refits)
        if (one["motor"], one["parameter"]) == ("motor 2", "alpha_Ra")
    ]

    assert row["alpha_Ra"] == long["median"] == refits[2].estimates["alpha_Ra"].median
    low, median, high = pool.motors[2]
    assert (row["alpha_Ra_pooled_q05"], row["alpha_Ra_pooled"]) == (low, median)
    assert (long["pooled_q05"], long["pooled_q95"]) == (low, high)
    assert tuple(long) == POOLED_COLUMNS
    assert len(csv_text(pooled_rows(refits), POOLED_COLUMNS).splitlines()) == 1 + 2 * 8


def test_page_states_mean_and_spread_of_each_type() -> None:
    """The row of a type names it, its coefficient and its number of motors."""
    refits = [dataclasses.replace(refit, type="RE <40>") for refit in fleet(8, 3)]

    text = render_fleet("Refit", refits).partition('id="types"')[2]

    assert "RE &lt;40&gt;" in text
    assert "<code>alpha_Ra</code>" in text
    assert 'class="stem pooled"' in render_fleet("Refit", refits)
    assert CENTRE["alpha_Ra"] == pytest.approx(pool_of(refits).mean[1], rel=0.05)


def test_short_noisy_campaigns_inform_about_each_other_and_about_a_cold_motor() -> None:
    """Real fits: six heated motors of a type with a known spread of 1 %, one run at 25 degC only.

    Of six 90 % intervals at least four hold with a probability of 98 %.
    """
    rng = np.random.default_rng(2)
    base = motor_named("servo 100 W")
    coefficients = 3.9e-3 * (1.0 + 0.01 * rng.normal(size=7))
    motors = [
        dataclasses.replace(base, values=(base.values[0], alpha, *base.values[2:]))
        for alpha in coefficients
    ]
    runs = [campaign(motor, seed=n, rows=370, noise=0.1) for n, motor in enumerate(motors[:6])]
    runs.append([_cold(motors[6], rng)])

    refits = [_fitted(some) for some in runs]
    pool = pool_of(refits)

    assert not refits[6].estimates["alpha_Ra"].is_identified
    widths = np.array(
        [(high - low) / _width(refits[n]) for n, (low, _, high) in pool.motors.items()]
    )
    inside = [low < coefficients[n] < high for n, (low, _, high) in pool.motors.items()]
    assert pool.count == 6
    assert sum(inside[:6]) >= 4
    assert inside[6]
    assert widths[:6].mean() < 0.9
    assert widths[6] < 0.3


def _cold(motor: Motor, rng: np.random.Generator) -> Run:
    """A run at 25 degC with noise of one per cent."""
    voltage = drive(motor, "steps", 370, rng)
    run = run_of(motor, voltage, np.full(370, 25.0), np.zeros(2), "zoh", "cold.csv")
    noise = 0.01 * rng.standard_normal((2, 370))
    return dataclasses.replace(
        run,
        current=run.current + noise[0] * run.current.std(),
        speed=run.speed + noise[1] * run.speed.std(),
    )


def _fitted(runs: list[Run]) -> Refit:
    options = FitOptions(effects=False, posterior=False)
    return refit_of("m", "fitted", identify(runs, (), options).result)


def _width(refit: Refit) -> float:
    own = refit.estimates["alpha_Ra"]
    assert own.q05 is not None
    assert own.q95 is not None
    return own.q95 - own.q05

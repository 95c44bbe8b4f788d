"""Simulator of `make benches`, its assessment of answers, and small campaigns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from benchmarks.benches.campaign import Settings, identified, wanted
from benchmarks.benches.cases import CASES, CELLS, is_right, wrong_kinds
from benchmarks.benches.motors import BenchMotor, drawn_motor
from benchmarks.benches.plant import Drive, Hidden, Trajectory, simulated
from benchmarks.benches.recording import recorded
from benchmarks.benches.table import page

MOTOR = drawn_motor(np.random.default_rng(3))
FRICTION = ("coulomb_friction", "brush_drop")


def run(
    voltage: NDArray[np.float64],
    hidden: Hidden,
    motor: BenchMotor = MOTOR,
    drive: Drive = Drive(MOTOR.rated_voltage),  # noqa: B008  frozen
) -> Trajectory:
    """True signals at 1 kHz and 25 degC, with an ideal source unless a drive is given."""
    rows = voltage.size
    warm, quiet = np.full(rows, 25.0), np.zeros(rows)
    times = 1e-3 * np.arange(rows, dtype=np.float64)
    return simulated(motor, hidden, drive, times, voltage, warm, quiet, 0.0)


def held(volts: float, rows: int = 400) -> NDArray[np.float64]:
    """Constant voltage [V]."""
    return np.full(rows, volts)


def number_of(cell: str) -> int:
    """Number of the first campaign of a cell."""
    return next(wanted(0, 1, cell))


def test_a_linear_motor_follows_the_matrix_exponential() -> None:
    """Reference: exact solution for a voltage held between samples."""
    volts = np.repeat(np.random.default_rng(0).uniform(-10.0, 10.0, 60), 5)
    m = MOTOR
    a = np.array([[-m.Ra25 / m.L, -m.Kt25 / m.L], [m.Kt25 / m.J, -m.b / m.J]])
    whole = expm(1e-3 * np.vstack([np.column_stack([a, [1.0 / m.L, 0.0]]), np.zeros(3)]))
    states = np.zeros((volts.size, 2))
    for k in range(volts.size - 1):
        states[k + 1] = whole[:2, :2] @ states[k] + whole[:2, 2] * volts[k]

    found = run(volts, Hidden())

    assert found.current == pytest.approx(states[:, 0], abs=1e-4 * m.rated_current)
    assert found.speed == pytest.approx(states[:, 1], abs=1e-4 * m.rated_speed)


def test_dry_friction_holds_the_shaft_until_the_torque_exceeds_it() -> None:
    """At standstill, the torque Kt v / Ra must exceed Coulomb plus Stribeck friction."""
    hidden = Hidden(dry=0.08 * MOTOR.rated_torque, stribeck=0.02 * MOTOR.rated_torque)
    limit = 0.1 * MOTOR.rated_torque * MOTOR.Ra25 / MOTOR.Kt25

    assert not run(held(0.99 * limit), hidden).speed.any()
    assert run(held(1.01 * limit), hidden).speed[-1] > 0.0


def test_friction_and_brush_drop_shift_the_steady_state_by_their_sizes() -> None:
    """At constant speed, Kt i = b w + T and v = Ra i + Kt w + V tanh(i / knee)."""
    hidden = Hidden(
        dry=0.05 * MOTOR.rated_torque,
        brush=0.04 * MOTOR.rated_voltage,
        brush_knee=0.03 * MOTOR.rated_current,
    )
    volts = 0.5 * MOTOR.rated_voltage

    end = run(held(volts), hidden)
    i, w = end.current[-1], end.speed[-1]

    drop = hidden.brush * np.tanh(i / hidden.brush_knee)
    assert MOTOR.Kt25 * i == pytest.approx(MOTOR.b * w + hidden.dry, rel=1e-4)
    assert volts == pytest.approx(MOTOR.Ra25 * i + MOTOR.Kt25 * w + drop, rel=1e-4)


def test_the_shaft_stops_at_the_time_given_by_the_friction() -> None:
    """With Coulomb friction only, the speed falls by T / J per second and stays at zero."""
    free = BenchMotor(**{**vars(MOTOR), "Kt25": 1e-6, "b": 1e-12, "alpha_Kt": 0.0})
    hidden = Hidden(dry=0.02 * MOTOR.rated_torque, cogging=0.0)
    pushed = 40.0 * hidden.dry / free.Kt25 * free.Ra25
    volts = np.concatenate([held(pushed, 4), held(0.0, 600)])

    speed = run(volts, hidden, free).speed
    moving = speed[20:][speed[20:] > 0.0]

    assert np.diff(moving) == pytest.approx(-1e-3 * hidden.dry / free.J, rel=1e-3)
    assert not speed[20 + moving.size :].any()


def test_a_dead_zone_a_supply_and_a_dead_time_take_their_voltage() -> None:
    """Above the dead zone, the terminal voltage is v - d^2 R_s i - V_dt."""
    limit = 0.02 * MOTOR.rated_voltage
    stage = Drive(
        MOTOR.rated_voltage,
        dead_zone=limit,
        dead_time=0.01 * MOTOR.rated_voltage,
        source=0.2 * MOTOR.Ra25,
        current_scale=1e-3 * MOTOR.rated_current,
    )
    volts = 0.6 * MOTOR.rated_voltage

    assert not run(held(0.99 * limit), Hidden(), drive=stage).speed.any()
    end = run(held(volts), Hidden(), drive=stage)
    i, w = end.current[-1], end.speed[-1]

    left = volts - 0.36 * stage.source * i - stage.dead_time
    assert left == pytest.approx(MOTOR.Ra25 * i + MOTOR.Kt25 * w, rel=1e-4)


def test_the_same_number_records_the_same_campaign() -> None:
    """`--first N --count 1` repeats a campaign of the log."""
    one, other = (recorded(CELLS[3], 3, 200).tables for _ in range(2))

    assert all(table.equals(again) for table, again in zip(one, other, strict=True))


@pytest.mark.parametrize("number", range(len(CELLS)))
def test_each_cell_hides_its_number_of_effects(number: int) -> None:
    """Clean motors have no effect, mixed ones three to five, and every run has samples."""
    measured = recorded(CELLS[number], number, 300)
    table = measured.tables[-1]

    hidden = {"clean": (0,), "friction": (2,), "mixed": (3, 4, 5)}[CELLS[number].motor]
    assert len(measured.hidden) in hidden
    assert len(measured.tables) == 4
    assert len(table) > 280
    assert ("temperature_degC" in table) == (CELLS[number].case.name != "no_thermometer")
    assert table["speed_rad_s"].abs().max() > 0.1 * measured.motor.rated_speed
    assert (measured.noise > 0.0).all()


def test_required_effects_must_be_named_and_no_others() -> None:
    """Reference: the tables in the docstring of `benchmarks.benches.cases`."""
    filtered, plain = CASES["current_filter"], CASES["narrow"]

    assert is_right(plain, FRICTION, FRICTION)
    assert not is_right(plain, FRICTION, ("brush_drop",))
    assert not is_right(filtered, FRICTION, FRICTION)
    assert is_right(filtered, FRICTION, FRICTION, withheld=("current_filter",))
    assert is_right(filtered, (), ("current_filter",))
    assert wrong_kinds(plain, (), ("current_filter",)) == ["current_filter"]
    assert wrong_kinds(filtered, (), ("current_filter",)) == []


def test_one_direction_takes_either_naming_and_an_alternative() -> None:
    """With one direction of motion, load torque and friction are confounded."""
    either = ("load_torque", "voltage_offset")

    assert is_right(CASES["one_way"], FRICTION, either)
    assert is_right(CASES["one_way"], FRICTION, ("brush_drop", "cogging_torque"), ("load_torque",))
    assert wrong_kinds(CASES["one_way"], FRICTION, either) == []
    assert not is_right(CASES["narrow"], FRICTION, either, FRICTION)


@pytest.fixture(scope="module")
def clean() -> dict[str, Any]:
    """Result for a clean motor between 20 and 40 degC, from files to comparison."""
    return identified(number_of("narrow:clean"), Settings(rows=1000))


def test_a_clean_motor_of_a_small_campaign_stays_clean(clean: dict[str, Any]) -> None:
    """No effect is hidden; a single campaign cannot test coverage, so 5 sd are allowed."""
    assert clean["named"] == []
    assert clean["right"]
    assert max(clean["ratios"]) < 1.05
    assert max(abs(value) for value in clean["deviations"].values()) < 5.0
    assert clean["gop"] > 0.0


def test_refused_runs_are_a_line_of_the_log() -> None:
    """A fit needs 50 samples per run; these have 11."""
    line = identified(number_of("narrow:clean"), Settings(rows=11))

    assert "InputError" in line["refused"]
    assert "named" not in line


def test_the_page_counts_the_lines_of_the_log(clean: dict[str, Any]) -> None:
    """One correct campaign, one with a wrong effect, and one that is refused."""
    wrong = clean | {"named": ["load_torque"], "wrong": ["load_torque"], "sure": ["load_torque"]}
    wrong |= {"number": 1000, "probabilities": [0.99]}
    refused = {"number": 1001, "cell": clean["cell"], "refused": "InputError: too short"}

    text = page([clean, wrong, refused], "command", 1000, "sampled")

    assert "| narrow, clean | 3 | 1 | 0 | 100 % | 50 % | 1 | 0 | 100 % |" in text
    assert "| 1000 | narrow:clean | nothing | load_torque (0.99) |" in text
    assert "| 1001 | narrow:clean | nothing | InputError: too short |" in text

"""Probability of a specification, search for gains, and what is said if there are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from identification.errors import OptionError
from identification.tuning import (
    METRICS,
    UncertainMotor,
    motor_of,
    parse_specification,
    tune,
)
from identification.tuning.judge import slack_at
from tests.tuning.test_drive import SERVO

DRIVE = "voltage=24,current=8,sample_time=1e-3,delay=5e-4"


def uncertain(spread: float = 0.05, count: int = 20) -> UncertainMotor:
    """Servo whose parameters are known to a relative standard deviation."""
    rng = np.random.default_rng(5)
    return motor_of({k: v * np.exp(spread * rng.standard_normal(count)) for k, v in SERVO.items()})


def judged(specification: str, controller: str = "PI:0.1,8", **options: Any) -> dict[str, Any]:
    """Judgement of one controller on the uncertain servo."""
    found = tune(
        uncertain(),
        parse_specification(f"{specification},{DRIVE}"),
        controllers=[controller],
        **{"temperatures": (0.0, 120.0), "step": 100.0, **options},
    )
    entry: dict[str, Any] = found["controllers"][0]
    return entry


def test_wide_limits_are_met_by_all_draws() -> None:
    """Limits beyond every value of every draw: the probability is exactly 1."""
    found = judged("rise_time=0.5,settling_time=1,overshoot=200,phase_margin=1,gain_margin=0.1")
    assert found["probability"] == 1.0
    assert found["meets"]


@pytest.mark.parametrize("name", METRICS)
def test_a_tighter_limit_never_raises_the_probability(name: str) -> None:
    """The set of draws that meet a tighter limit is a subset."""
    row = [entry[name] for entry in judged("overshoot=100")["temperatures"]]
    ends = min(q["q05"] for q in row), max(q["q95"] for q in row)
    limits = np.linspace(*ends, 5)
    ordered = limits[::-1] if METRICS[name].is_upper else limits
    shares = [judged(f"{name}={max(limit, 1e-9)}")["probability"] for limit in ordered]
    assert (np.diff(shares) <= 0).all()
    assert shares[0] > shares[-1]


def test_distance_is_positive_exactly_if_the_required_fraction_meets() -> None:
    """By counting, for any probability and any distances."""
    rng = np.random.default_rng(1)
    for count in (1, 7, 40):
        slack = rng.standard_normal(count) + 1.0
        for probability in (0.5, 0.8, 0.95, 1.0):
            assert (slack_at(slack, probability) >= 0) == ((slack >= 0).mean() >= probability)


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_tuned_gains_meet_the_specification_when_judged_again(kind: str) -> None:
    """The text of the controller is all that a second judgement needs."""
    text = "rise_time=0.03,settling_time=0.15,overshoot=10,phase_margin=50,gain_margin=6"
    specification = parse_specification(f"{text},{DRIVE}")
    found = tune(uncertain(), specification, temperatures=(0, 120), kinds=[kind], step=100.0)
    entry = found["controllers"][0]
    assert entry["meets"]
    assert found["recommended"] == entry["controller"]
    again = judged(text, entry["controller"])
    assert again["probability"] == entry["probability"]
    assert again["slack"] == entry["slack"]


def test_tuning_is_deterministic() -> None:
    """Nothing is random: two searches give equal content."""
    specification = parse_specification(f"rise_time=0.03,overshoot=10,{DRIVE}")
    first, second = (tune(uncertain(), specification, kinds=["PI"], step=50.0) for _ in range(2))
    assert first == second


def test_an_impossible_rise_time_is_said_with_its_amount() -> None:
    """J w / (Kt I) bounds the rise from 10 % to 90 %: 0.8 x 100 rad/s with 8 A take 10.4 ms."""
    limit = 0.8 * 100.0 * SERVO["J"] / (SERVO["Kt25"] * 8.0)
    specification = parse_specification(f"rise_time={0.5 * limit},{DRIVE}")
    found = tune(motor_of(SERVO), specification, temperatures=[25], kinds=["PI"], step=100.0)
    entry = found["controllers"][0]
    assert not entry["meets"]
    assert entry["worst"]["metric"] == "rise_time"
    assert entry["worst"]["value"] >= limit
    assert "above the limit" in entry["statement"]
    assert "the limits of the drive are to blame" in entry["statement"]
    assert limit <= found["fastest_rise_s"] <= entry["worst"]["value"]
    assert found["recommended"] is None


@pytest.mark.parametrize(("drive", "step"), [("voltage=24", 300.0), ("delay=0", 100.0)])
def test_drive_that_is_too_weak_or_without_limits_has_no_fastest_rise(
    drive: str, step: float
) -> None:
    """At 24 V the servo turns at 209 rad/s at most; without limits the rise has no lower bound."""
    specification = parse_specification(f"rise_time=0.1,sample_time=1e-3,{drive}")

    found = tune(
        motor_of(SERVO), specification, temperatures=[25], controllers=["PI:0.1,8"], step=step
    )

    assert found["fastest_rise_s"] is None
    assert "to blame" not in found["controllers"][0]["statement"]


def test_a_step_beyond_the_voltage_is_said() -> None:
    """At 24 V the servo turns at 209 rad/s at most: Kt V / (Ra b + Kt^2)."""
    found = judged("settling_time=1", step=300.0, temperatures=[25])
    assert not found["meets"]
    assert "less than the step of 300 rad/s" in found["statement"]


def test_worst_case_is_at_the_temperature_where_the_metric_is_worst() -> None:
    """Reference: the 95 % quantiles of the rise time at each temperature."""
    found = judged("rise_time=0.01")
    rises = {at["temperature_degC"]: at["rise_time"]["q95"] for at in found["temperatures"]}
    assert found["worst"]["metric"] == "rise_time"
    assert found["worst"]["temperature_degC"] == max(rises, key=lambda t: rises[t])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rise=1,settling_time=x", ["rise is not known", "'settling_time=x'"]),
        ("rise_time=-1,overshoot=0", ["rise_time is -1", "overshoot is 0"]),
        ("voltage=24", ["requires nothing"]),
        ("overshoot=5,sample_time=1e-3,delay=1", ["delay is 1 s"]),
        (
            "rise_time=0.2,settling_time=0.1,sample_time=1e9",
            ["sample_time is 1e+09 s; expected at most the required 0.1 s"],
        ),
        ("overshoot=5,overshoot=6", ["given twice"]),
        ("overshoot=nan", ["overshoot is not a number"]),
    ],
)
def test_refused_specification_names_every_fault(text: str, expected: list[str]) -> None:
    """Each fault stands in the one message."""
    with pytest.raises(OptionError) as refused:
        parse_specification(text)
    for part in expected:
        assert part in str(refused.value)


def test_refused_options_are_named_together() -> None:
    """Kind, probability and step in one message."""
    with pytest.raises(OptionError, match=r"'XY'.*probability is 2.*step is -1"):
        tune(
            motor_of(SERVO), parse_specification("overshoot=5"),
            kinds=["XY"], probability=2.0, step=-1.0,
        )  # fmt: skip


def test_tuned_loops_keep_the_usual_margins_if_the_specification_names_none() -> None:
    """Fast gains alone would leave a few degrees; the usual least are 30 degrees and 6 dB."""
    found = tune(
        uncertain(),
        parse_specification(f"rise_time=0.02,{DRIVE}"),
        kinds=["PI"],
        temperatures=(0.0, 120.0),
        step=100.0,
    )
    assert found["specification"]["phase_margin"] == 30.0
    assert found["specification"]["gain_margin"] == 6.0
    (entry,) = found["controllers"]
    assert entry["meets"]
    assert min(one["phase_margin"]["q05"] for one in entry["temperatures"]) >= 30.0

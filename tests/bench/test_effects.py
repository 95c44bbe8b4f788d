"""Each effect acts in its equation and depends on its drivers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import EFFECTS, EffectRequest, make_campaign
from bench.effects import RunPlan, Setup
from bench.motors import motor
from bench.physics import derivative
from bench.plant import STATES, Plant, clean_plant, new_drive
from bench.sensors import NOISELESS

Array = NDArray[np.float64]
ALL = [(name, law) for name, effect in EFFECTS.items() for law in effect.laws]
LISTED = {
    "coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_temperature",
    "load_torque", "load_step", "cogging_torque", "inertia_change", "shaft_compliance",
    "brush_drop", "flux_saturation", "inductance_saturation", "self_heating", "winding_lag",
    "magnet_lag", "resistance_curvature", "demagnetization", "current_offset", "voltage_offset",
    "speed_offset", "channel_delay", "speed_filter", "current_filter", "input_hold",
}  # fmt: skip
# Effects that add one term to one equation, which can be tested alone.
TERMS = [
    (name, law)
    for name, law in ALL
    if EFFECTS[name].equation in {"electrical", "mechanical"}
    and name not in {"load_step", "inertia_change", "shaft_compliance", "bristle_friction"}
    and name not in {"backlash", "inductance_saturation"}
]
HEAT = [
    (name, law) for name in ("self_heating", "resistance_curvature", "demagnetization")
    for law in EFFECTS[name].laws
]  # fmt: skip
STEPS = [(name, law) for name, law in ALL if name in {"load_step", "inertia_change"}]
# Additional signals of the term: its direction, or a factor of the nominal equation.
BESIDES = {
    "flux_saturation": {"speed", "temperature"},
    "load_dependent_friction": {"temperature"},
    "load_torque": {"time"},
    "run_in": {"speed"},
}
AT = {
    "time": 0.3,
    "current": 0.8,
    "speed": 0.55,
    "position": 0.7,
    "voltage": 0.6,
    "temperature": 70,
}


def changed_setup(name: str, law: str, size: float = 0.1) -> Setup:
    """Setup of the servo with one hidden effect."""
    entry = motor("servo_150w")
    runs = [RunPlan("training", 6.0, np.full(100, 40.0 + 20.0 * k)) for k in range(3)]
    setup = Setup(entry, clean_plant(entry), runs, np.random.default_rng(3))
    EFFECTS[name].laws[law](setup, size)
    return setup


def term(plant: Plant, at: dict[str, float]) -> Array:
    """Difference of the plant's balances to those of the clean plant [V, N m]."""
    entry = motor("servo_150w")
    drive = new_drive()
    drive["voltage"], drive["temperature"] = at["voltage"] * 48.0, at["temperature"]
    drive["direction"] = np.sign(at["speed"])
    state = np.zeros(len(STATES))
    state[:3] = at["current"] * 4.2, at["speed"] * 377.0, at["position"]
    rates = np.zeros((2, len(STATES)))
    for row, record in enumerate((plant, clean_plant(entry))):
        derivative(at["time"], state, rates[row], record, drive)
    gap = rates[0] - rates[1]
    return np.array([gap[0] * entry.L, gap[1] * entry.J])


def test_bench_has_every_listed_effect_and_at_least_eight_others() -> None:
    """The listed effects are those of the contract; at least eight others are unlisted."""
    listed = {name for name, effect in EFFECTS.items() if effect.is_listed}

    assert listed == LISTED
    assert len(EFFECTS) - len(listed) >= 8


def test_every_effect_has_more_than_one_law() -> None:
    """An effect name is a type and not a formula; only the hold of the voltage has one law."""
    assert [name for name, effect in EFFECTS.items() if len(effect.laws) < 2] == ["input_hold"]


@pytest.mark.parametrize(("name", "law"), TERMS)
def test_term_enters_its_equation_and_depends_on_its_drivers(name: str, law: str) -> None:
    """A change of a driver changes the term; a change of any other signal does not."""
    effect, plant = EFFECTS[name], changed_setup(name, law).plant
    row = 0 if effect.equation == "electrical" else 1
    here = term(plant, AT)

    moved = {
        signal
        for signal in AT
        for factor in (0.1, -0.6, 1.6)
        if abs(term(plant, {**AT, signal: AT[signal] * factor})[row] - here[row])
        > 1e-9 * [48.0, motor("servo_150w").rated_torque][row]
    }

    assert set(effect.drivers) <= moved
    assert moved <= set(effect.drivers) | BESIDES.get(name, set())
    if name != "flux_saturation":
        assert abs(here[1 - row]) < 1e-12


@pytest.mark.parametrize(
    ("name", "law"),
    [
        (name, law)
        for name, law in TERMS
        if law == EFFECTS[name].textbook and EFFECTS[name].size_means.startswith("rated")
    ],
)
def test_size_scales_terms_relative_to_rated_torque_or_voltage(name: str, law: str) -> None:
    """One per cent of the size gives one per cent of the term."""
    row = 0 if EFFECTS[name].equation == "electrical" else 1

    at = {**AT, "speed": 0.05 if name == "stribeck_friction" else AT["speed"]}

    large, small = (term(changed_setup(name, law, size).plant, at)[row] for size in (0.1, 0.001))

    scale = [48.0, motor("servo_150w").rated_torque][row]
    assert large == pytest.approx(100.0 * small, rel=1e-6)
    assert 1e-3 * scale < abs(large) <= 0.15 * scale


@pytest.mark.parametrize("size", ["small", "large"])
@pytest.mark.parametrize(("name", "law"), ALL)
def test_every_law_gives_plausible_runs(name: str, law: str, size: str) -> None:
    """All channels are finite, within twice the rated speed and the current limit."""
    amount = EFFECTS[name].typical[size == "large"]

    campaign = make_campaign("wiper_60w", [EffectRequest(name, amount, law)], seed=2, rows=400)

    told = campaign.truth["effects"][0]
    assert (told["name"], told["law"], told["size"]) == (name, law, amount)
    for run in campaign.runs:
        assert np.isfinite(run.frame.to_numpy()).all()
        assert run.frame["speed_rad_s"].abs().max() < 2.0 * campaign.motor.rated_speed
        assert run.frame["current_A"].abs().max() < 4.0 * campaign.motor.rated_current


@pytest.mark.parametrize(
    ("name", "law"),
    # A lag or knee of zero width is infinitely stiff and not equal to the clean plant.
    [pair for pair in [*TERMS, *HEAT, *STEPS] if pair != ("dead_zone", "soft")],
)
def test_effect_of_negligible_size_changes_nothing(name: str, law: str) -> None:
    """Reference: the campaign of the clean motor with the same seed."""
    options: dict[str, Any] = {
        "rows": 300,
        "training": 2,
        "validation": 0,
        "noise": NOISELESS,
        "tolerance": 1e-10,
    }

    clean = make_campaign("wiper_60w", seed=5, **options)
    with_effect = make_campaign("wiper_60w", [EffectRequest(name, 1e-9, law)], seed=5, **options)

    for one, other in zip(clean.runs, with_effect.runs, strict=True):
        scale = one.frame.abs().max()
        assert ((one.frame - other.frame).abs() / scale).to_numpy().max() < 1e-5


@pytest.mark.parametrize("channel", ["current", "voltage", "speed"])
def test_offset_adds_to_its_channel_and_to_no_other(channel: str) -> None:
    """The run differs from the clean one by a constant in one column."""
    options: dict[str, Any] = {"rows": 300, "noise": NOISELESS}
    column = {"current": "current_A", "voltage": "voltage_V", "speed": "speed_rad_s"}[channel]

    clean = make_campaign("servo_150w", seed=5, **options)
    offset = make_campaign("servo_150w", [(f"{channel}_offset", 0.03)], seed=5, **options)

    value = offset.truth["effects"][0]["values"]["offset"]
    gap = offset.runs[0].frame - clean.runs[0].frame
    assert gap[column].to_numpy() == pytest.approx(np.full(300, value), rel=1e-9)
    assert not gap.drop(columns=column).to_numpy().any()


def test_delay_of_whole_samples_shifts_the_column() -> None:
    """Reference: the true speed two samples earlier, from the hidden states."""
    campaign = make_campaign(
        "servo_150w", [EffectRequest("channel_delay", 0.2, "speed")], noise=NOISELESS, rows=300
    )

    run = campaign.runs[0]

    true = run.hidden.state("speed")[-302:-2]
    assert run.frame["speed_rad_s"].to_numpy() == pytest.approx(true, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("name", "field"), [("load_step", "step_torque"), ("inertia_change", "J")])
def test_effect_of_one_run_is_in_one_training_run(name: str, field: str) -> None:
    """Exactly one run has the effect, and it is not the first one."""
    setup = changed_setup(name, EFFECTS[name].textbook)

    touched = [number for number, run in enumerate(setup.runs) if field in run.overrides]

    assert len(touched) == 1
    assert touched[0] in {1, 2}


def test_effects_act_together() -> None:
    """The term is the sum of two torques of known size."""
    entry = motor("servo_150w")
    setup = changed_setup("quadratic_drag", "square", 0.1)
    EFFECTS["load_torque"].laws["constant"](setup, 0.05)
    setup.plant["load"] = abs(setup.plant["load"])

    missing = term(setup.plant, {**AT, "speed": 1.0})[1]

    assert missing == pytest.approx(-0.15 * entry.rated_torque, rel=1e-9)


def test_run_in_continues_from_run_to_run() -> None:
    """Each run starts with the running time of all previous runs."""
    setup = changed_setup("run_in", "dry")

    assert [run.overrides["elapsed_before"] for run in setup.runs] == [0.0, 6.0, 12.0]


def test_unknown_effect_and_unknown_law_are_refused_with_the_known_ones() -> None:
    """The message lists the names, which reveals a typing error."""
    with pytest.raises(KeyError, match="no effect 'friction'; there are coulomb_friction"):
        make_campaign("servo_150w", ["friction"])
    with pytest.raises(KeyError, match="brush_drop has no law 'sign'; it has knee"):
        make_campaign("servo_150w", [EffectRequest("brush_drop", 0.1, "sign")])


def test_hidden_truth_has_the_fields_of_an_evaluation() -> None:
    """Type, equation, drivers with the main one first, law, size and values of each effect."""
    effect = make_campaign("servo_150w", ["load_dependent_friction"], rows=100).truth["effects"][0]

    assert effect["equation"] == "mechanical"
    assert effect["drivers"][0] == "current"
    assert not effect["listed"]
    assert dataclasses.is_dataclass(EFFECTS["load_dependent_friction"])
    assert set(effect) == {
        "name", "equation", "drivers", "listed", "law", "role", "size", "size_means", "values"
    }  # fmt: skip

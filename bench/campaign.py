"""Measurement campaigns: one motor, its hidden effects, and the runs recorded from it.

    >>> campaign = make_campaign("servo_150w", [("brush_drop", 0.03)], seed=1, rows=400)
    >>> campaign.truth["effects"][0]["law"]
    'knee'
    >>> len(campaign.training), len(campaign.validation)
    (5, 2)

For one motor and one set of options, excitation, temperatures and noise depend on the seed only.
Campaigns with and without an effect therefore differ by the effect alone.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bench.effects import EFFECTS, BenchEffect, Law, RunPlan, Setup
from bench.motors import Motor, random_motor
from bench.motors import motor as motor_named
from bench.options import BenchOptions
from bench.plant import clean_plant
from bench.recording import BenchRun, channel_decimals, channel_steps, record_run
from bench.temperature import run_temperature, temperature_levels

__all__ = ["BenchRun", "Campaign", "EffectRequest", "make_campaign"]


@dataclass(frozen=True)
class EffectRequest:
    """An effect to add to a motor.

    Args:
        name: Key of `bench.effects.EFFECTS`.
        size: Size as defined by `size_means` of the effect; None for the geometric mean of its
            typical range.
        law: One of its laws; None for the textbook law.
        role: Runs with the effect: all, or those of one role.
    """

    name: str
    size: float | None = None
    law: str | None = None
    role: Literal["all", "training", "validation"] = "all"


@dataclass(frozen=True)
class Campaign:
    """Recorded runs of one motor with the true values.

    Args:
        motor: The motor; its nominal parameters are the true ones.
        runs: Runs in the order of recording, training first.
        truth: True parameters, effects and noise as plain data for JSON.
        decimals: Number of decimals that represents each column without loss, by column.
    """

    motor: Motor
    runs: tuple[BenchRun, ...]
    truth: dict[str, Any]
    decimals: dict[str, int]

    @property
    def training(self) -> tuple[BenchRun, ...]:
        """Training runs."""
        return tuple(run for run in self.runs if run.role == "training")

    @property
    def validation(self) -> tuple[BenchRun, ...]:
        """Validation runs."""
        return tuple(run for run in self.runs if run.role == "validation")

    def write(self, directory: Path | str) -> list[Path]:
        """Write one CSV file per run and ``truth.json``; return the paths, runs first."""
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for run in self.runs:
            paths.append(folder / run.name)
            paths[-1].write_text(self.csv(run), encoding="utf-8", newline="\n")
        paths.append(folder / "truth.json")
        paths[-1].write_text(json.dumps(self.truth, indent=2) + "\n", encoding="utf-8")
        return paths

    def csv(self, run: BenchRun) -> str:
        """Text of the file of a run."""
        columns = [
            [f"{value:.{self.decimals[name]}f}" for value in run.frame[name].to_list()]
            for name in run.frame.columns
        ]
        lines = [
            ",".join(run.frame.columns),
            *(",".join(row) for row in zip(*columns, strict=True)),
        ]
        return "\n".join(lines) + "\n"


def _as_request(effect: str | tuple[str, float] | EffectRequest) -> EffectRequest:
    if isinstance(effect, EffectRequest):
        return effect
    return EffectRequest(effect) if isinstance(effect, str) else EffectRequest(*effect)


def _resolve(request: EffectRequest) -> tuple[BenchEffect, float, str]:
    """Effect, size and law of a request, with the defaults filled in.

    Raises:
        KeyError: The effect or the law is unknown; the message lists the known ones.
    """
    if request.name not in EFFECTS:
        raise KeyError(f"no effect '{request.name}'; there are {', '.join(EFFECTS)}")
    effect = EFFECTS[request.name]
    law = request.law or effect.textbook
    if law not in effect.laws:
        raise KeyError(f"{effect.name} has no law '{law}'; it has {', '.join(effect.laws)}")
    size = request.size if request.size is not None else math.sqrt(math.prod(effect.typical))
    return effect, size, law


def _plan_runs(motor: Motor, options: BenchOptions, seed: int) -> list[RunPlan]:
    """Roles and temperatures of all runs."""
    rng = np.random.default_rng([seed, 1001])
    levels = temperature_levels(options.training, options.validation, options.temperature_span, rng)
    duration = options.rows * (options.sample_interval or motor.sample_interval)
    return [
        RunPlan(
            "training" if number < options.training else "validation",
            duration,
            run_temperature(level, options.rows, options.temperature_motion, rng),
        )
        for number, level in enumerate(levels)
    ]


def _apply_to_role(setup: Setup, law: Law, size: float, role: str) -> dict[str, float]:
    """Add an effect to the runs of one role only.

    Raises:
        ValueError: The effect changes neither the plant nor a sensor offset, so it cannot be
            limited to some runs.
    """
    other = dataclasses.replace(
        setup, plant=setup.plant.copy(), offsets={}, delays={}, difference_time=0.0
    )
    values = law(other, size)
    changed = {
        str(name): float(other.plant[name])
        for name in other.plant.dtype.names or ()
        if other.plant[name] != setup.plant[name]
    }
    if not changed and not other.offsets:
        raise ValueError("this effect is in all runs or in none; leave its role at 'all'")
    for run in setup.runs:
        if run.role == role:
            run.overrides.update(changed)
        elif other.offsets:
            run.offset_scale = 0.0
    setup.offsets.update(other.offsets)
    return values


def _apply(setup: Setup, requests: Sequence[EffectRequest]) -> list[dict[str, Any]]:
    """Add effects to the setup; return their true values."""
    told = []
    for request in requests:
        effect, size, law = _resolve(request)
        if request.role == "all":
            values = effect.laws[law](setup, size)
        else:
            values = _apply_to_role(setup, effect.laws[law], size, request.role)
        told.append(
            {
                "name": effect.name,
                "equation": effect.equation,
                "drivers": list(effect.drivers),
                "listed": effect.is_listed,
                "law": law,
                "role": request.role,
                "size": size,
                "size_means": effect.size_means,
                "values": {name: float(value) for name, value in values.items()},
            }
        )
    return told


def _noise_truth(setup: Setup, options: BenchOptions) -> dict[str, Any]:
    """Standard deviation of each logged channel, including quantisation."""
    noise, steps = options.noise, channel_steps(setup, options.noise)
    levels = {
        "voltage_V": noise.voltage * setup.motor.rated_voltage,
        "current_A": noise.current * setup.motor.rated_current,
        "speed_rad_s": noise.speed * setup.motor.rated_speed,
        "temperature_degC": noise.temperature,
    }
    total = {name: math.hypot(sd, steps[name] / math.sqrt(12.0)) for name, sd in levels.items()}
    return {**total, "kind": noise.kind}


def make_campaign(
    motor: Motor | str | int,
    effects: Iterable[str | tuple[str, float] | EffectRequest] = (),
    seed: int = 0,
    options: BenchOptions | None = None,
    **changes: Any,
) -> Campaign:
    """Simulate and record a campaign on a motor with hidden effects.

    Args:
        motor: A motor, the name of one in the table, or the seed of a random one.
        effects: Names, names with sizes, or requests; the effects act together.
        seed: Seed of the campaign; equal arguments and seeds give bit-identical campaigns.
        options: Options of the campaign.
        **changes: Fields of `BenchOptions` that replace those of `options`, for example
            ``rows=2000``.

    Raises:
        KeyError: The motor, the effect or the law is unknown.
        SimulationFailed: The plant with these effects diverges.
    """
    chosen = dataclasses.replace(options or BenchOptions(), **changes)
    if isinstance(motor, str):
        motor = motor_named(motor)
    elif isinstance(motor, int):
        motor = random_motor(motor)
    if chosen.sample_interval is not None:
        motor = dataclasses.replace(motor, sample_interval=chosen.sample_interval)
    setup = Setup(
        motor,
        clean_plant(motor),
        _plan_runs(motor, chosen, seed),
        np.random.default_rng([seed, 1002]),
        is_linear=chosen.hold == "foh",
    )
    told = _apply(setup, [_as_request(effect) for effect in effects])
    runs, peak = [], -273.0
    for number in range(len(setup.runs)):
        run, peak = record_run(setup, chosen, number, seed, peak)
        runs.append(run)
    truth = {
        "motor": motor.name,
        "rated": {
            "voltage_V": motor.rated_voltage,
            "current_A": motor.rated_current,
            "speed_rad_s": motor.rated_speed,
            "torque_N_m": motor.rated_torque,
        },
        "parameters": motor.parameters,
        "effects": told,
        "noise": _noise_truth(setup, chosen),
        "hold": {"declared": chosen.hold, "true": "foh" if setup.is_linear else "zoh"},
        "seed": seed,
        "runs": [
            {
                "file": run.name,
                "role": run.role,
                "rows": len(run.frame),
                "excitation": run.excitation,
                "temperature_degC": [
                    round(float(run.temperature.min()), 2),
                    round(float(run.temperature.max()), 2),
                ],
            }
            for run in runs
        ],
    }
    decimals = channel_decimals(setup, chosen)
    return Campaign(motor, tuple(runs), truth, decimals)

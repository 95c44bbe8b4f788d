"""A made-up campaign for the report: arrays of the right shape, from a motor with known parameters.

No part of the identification runs here; the report must only draw what it is given.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal

from identification.model.composite import MotorModel
from identification.model.printing import printed_equations
from identification.quantities import DECLARED_PARAMETERS
from identification.result.entries import parameter_entry, quantity_entry
from identification.result.report_data import (
    CandidateRow,
    CoefficientCurve,
    MissingTerm,
    MissingTrace,
    PosteriorChain,
    ReportData,
    RunTraces,
    SearchAccount,
)
from identification.speed_loop import StepCurve

Array = NDArray[np.float64]

TRUTH = {
    "Ra25": 0.59,
    "alpha_Ra": 0.0040,
    "Kt25": 0.071,
    "alpha_Kt": -0.0020,
    "J": 4.2e-5,
    "b": 6.0e-5,
    "L": 5.1e-4,
}
NOISE = {"current_A": 0.05, "speed_rad_s": 0.35}
METRICS = {
    "rise_time_s": (0.7193, "s"),
    "settling_time_s": (1.2826, "s"),
    "peak": (0.5258, "1"),
    "peak_time_s": (float("nan"), "s"),
    "overshoot_percent": (0.0, "%"),
    "steady_state": (0.5258, "1"),
    "gain_margin_db": (float("inf"), "dB"),
    "phase_margin_deg": (141.2, "deg"),
    "bandwidth_rad_s": (3.05, "rad/s"),
}


def _simulate(voltage: Array, interval: float, temperature: float, drag: float) -> Array:
    """(2, n_sample) current and speed of the motor from rest, voltage held between samples."""
    resistance = TRUTH["Ra25"] * (1 + TRUTH["alpha_Ra"] * (temperature - 25))
    torque = TRUTH["Kt25"] * (1 + TRUTH["alpha_Kt"] * (temperature - 25))
    system = np.array(
        [
            [-resistance / TRUTH["L"], -torque / TRUTH["L"]],
            [torque / TRUTH["J"], -(TRUTH["b"] + drag) / TRUTH["J"]],
        ]
    )
    drive = np.array([[1 / TRUTH["L"]], [0.0]])
    step = linalg.expm(np.block([[system, drive], [np.zeros((1, 3))]]) * interval)
    numerator, denominator = signal.ss2tf(step[:2, :2], step[:2, 2:], np.eye(2), np.zeros((2, 1)))
    return np.array([signal.lfilter(row, denominator, voltage) for row in numerator])


def _run(index: int, role: str, rows: int, with_effect: bool) -> RunTraces:
    rng = np.random.default_rng(100 + index)
    interval = 0.002
    levels = rng.uniform(-24, 24, rows // 400 + 1)
    voltage = np.repeat(levels, 400)[:rows]
    warmth = (25.0, 60.0, 100.0)[index % 3]
    time = np.asarray(interval * np.arange(rows), dtype=np.float64)
    after = _simulate(voltage, interval, warmth, 0.0)
    before = _simulate(voltage, interval, warmth, 1.2e-5) if with_effect else None
    noise = rng.standard_normal((2, rows)) * np.array(list(NOISE.values()))[:, None]
    return RunTraces(
        name=f"bench_{role}_{index}.csv",
        role="training" if role == "training" else "validation",
        time=time,
        voltage=voltage + 0.02 * rng.standard_normal(rows),
        temperature=warmth + 18.0 * (1 - np.exp(-time / 20.0)) + 0.1 * rng.standard_normal(rows),
        measured_current=after[0] + noise[0],
        measured_speed=after[1] + noise[1],
        after_current=after[0],
        after_speed=after[1],
        before_current=before[0] if before is not None else None,
        before_speed=before[1] if before is not None else None,
    )


def _errors(ratio: float) -> dict[str, Any]:
    return {
        "current": {"rmse": ratio * 0.05, "nrmse": ratio * 0.008, "noise_ratio": ratio},
        "speed": {"rmse": ratio * 0.35, "nrmse": ratio * 0.003, "noise_ratio": ratio},
    }


def _parameters(rng: np.random.Generator, offset: float = 0.0) -> dict[str, Any]:
    entries = {}
    for name, truth in TRUTH.items():
        draws = truth * (1 + offset + 0.002 * rng.standard_normal(500))
        entries[name] = parameter_entry(draws, DECLARED_PARAMETERS[name].unit, identified=True)
    return entries


def _feedback(rng: np.random.Generator) -> list[dict[str, Any]]:
    return [
        {"temperature_degC": temperature, "controller": "P:1"}
        | {
            name: quantity_entry(value * factor * (1 + 0.003 * rng.standard_normal(300)), unit)
            for name, (value, unit) in METRICS.items()
        }
        for temperature, factor in ((25.0, 1.0), (125.0, 0.8))
    ]


def _diagnosis(
    declared: dict[str, Any], final: dict[str, Any], with_effect: bool
) -> dict[str, Any]:
    """Nothing where no effects were searched; a missing torque and shifts of 11 % otherwise."""
    if not with_effect:
        return {"residual": {}, "trace": {}, "searched": [], "remaining": {}, "shifts": {}}
    check = {
        "channel": "speed", "role": "training", "noise_ratio": 4.2, "noise_ratio_limit": 1.05,
        "whiteness_p": 1e-9, "voltage_outside": 0.1, "passed": False, "reason": "too large",
    }  # fmt: skip
    drivers = {"speed": {"correlation": -0.8, "share": 0.93}, "time": {"correlation": 0.0,
                                                                      "share": None}}  # fmt: skip
    lacking = {
        "strength": 0.012, "unit": "N m", "time_constant_s": 0.05, "log_likelihood_gain": 900.0,
        "p_value": 1e-12, "significant": True, "drivers": drivers,
    }  # fmt: skip
    complete = lacking | {"unit": "V", "p_value": 0.6, "significant": False}
    detection = {"missing": True, "sentence": "Something is missing.", "level": 0.01}
    return {
        "residual": detection | {"checks": [check]},
        "trace": {"electrical": complete, "mechanical": lacking, "curves": []},
        "searched": [],
        "remaining": {"missing": False, "sentence": "Nothing is missing.", "level": 0.01,
                      "checks": [], "electrical": complete, "mechanical": complete},
        "shifts": {
            name: {
                "before": declared[name],
                "after": final[name],
                "relative": quantity_entry(np.array([0.107, 0.11, 0.113]), "1"),
                "off": True,
            }
            for name in final
        },
    }  # fmt: skip


def _result(runs: list[RunTraces], with_effect: bool) -> dict[str, Any]:
    rng = np.random.default_rng(7)
    declared, final = _parameters(rng, 0.11 if with_effect else 0.0), _parameters(rng)
    friction = {
        "name": "coulomb_friction",
        "equation": "mechanical",
        "drivers": ["speed"],
        "probability": 0.991,
        "parameters": {
            "torque": parameter_entry(0.012 + 1e-4 * rng.standard_normal(500), "N m", True)
        },
        "evidence": {"explained": 0.93},
        "alternatives": [{"name": "viscous_temperature", "probability": 0.009}],
    }
    return {
        "schema_version": 1,
        "software": {"motorid": "0.1.0", "casadi": "3.8.2", "numpy": "2.4.6"},
        "hold": "zoh",
        "runs": [
            {
                "file": run.name,
                "sha256": hashlib.sha256(run.name.encode()).hexdigest(),
                "role": run.role,
                "rows": run.time.size,
                "sample_rate_hz": 500.0,
                "channels": {
                    "current_A": {"column": "CH2", "unit": "mA", "scale": 2.5, "offset": 0.1}
                },
            }
            for run in runs
        ],
        "declared": {"parameters": declared},
        "parameters": final,
        "effects": [friction] if with_effect else [],
        "diagnosis": _diagnosis(declared, final, with_effect),
        "errors": {
            "before": {
                role: _errors(4.2 if with_effect else 1.0) for role in ("training", "validation")
            },
            "after": {role: _errors(1.0) for role in ("training", "validation")},
        },
        "noise": dict(NOISE),
        "feedback": _feedback(rng),
        "feedback_before": _feedback(rng) if with_effect else [],
        "feedback_nonlinear": [
            entry
            | {
                "step_rad_s": 28.0,
                "effects": ["coulomb_friction"],
                "statement": "the speed settles",
            }
            for entry in _feedback(rng)
        ]
        if with_effect
        else [],
        "feedback_suited": [entry | {"controller": "PI:2,40"} for entry in _feedback(rng)],
        "sampler": {
            "walkers": 32,
            "steps": 600,
            "acceptance": 0.43,
            "autocorrelation_time": 9.4,
            "ess_min": 2040.0,
            "r_hat_max": 1.004,
            "converged": True,
            "draws": "chain",
            "pareto_k": None,
        },
        "warning_details": [{"code": "clipped_channel", "severity": "note", "fix": ""}]
        if with_effect
        else [],
        "warnings": ["bench_training_1.csv: 3 samples of current_A are at the limit of the sensor"]
        if with_effect
        else [],
    }


def _posterior() -> PosteriorChain:
    rng = np.random.default_rng(11)
    names = (*TRUTH, "noise_current", "noise_speed")
    size = len(names)
    mixing = np.eye(size) + 0.6 * np.diag(np.ones(size - 2), 2)
    steps = signal.lfilter([0.3], [1, -0.7], rng.standard_normal((600, 32, size)), axis=0)
    centre = np.array([*TRUTH.values(), 0.05, 0.35])
    units = (*(DECLARED_PARAMETERS[name].unit for name in TRUTH), "A", "rad/s")
    return PosteriorChain(names, units, centre * (1 + 0.002 * (steps @ mixing.T)), 50.0, 1.03)


def _coefficients(with_effect: bool) -> tuple[CoefficientCurve, ...]:
    grid = np.linspace(10, 130, 61)
    curves = []
    for name, unit in (("Ra", "ohm"), ("Kt", "N m/A")):
        median = TRUTH[f"{name}25"] * (1 + TRUTH[f"alpha_{name}"] * (grid - 25))
        width = 0.002 * TRUTH[f"{name}25"] * (1 + np.abs(grid - 60) / 40)
        before = 1.02 * median if with_effect else None
        curves.append(
            CoefficientCurve(name, unit, grid, median, median - width, median + width, before)
        )
    return tuple(curves)


def _steps() -> tuple[StepCurve, ...]:
    time = np.linspace(0, 3, 240)
    responses = []
    for temperature, final in ((25.0, 0.5258), (75.0, 0.46), (125.0, 0.3982)):
        median = final * (1 - np.exp(-3.1 * time) * (1 + 1.4 * time))
        responses.append(StepCurve(temperature, "P:1", time, median, 0.97 * median, 1.03 * median))
    return tuple(responses)


def _account(run: RunTraces) -> SearchAccount:
    rng = np.random.default_rng(3)
    speed = run.measured_speed
    torque = 0.012 * np.tanh(speed / 4.0) + 0.002 * rng.standard_normal(speed.size)
    grid = np.linspace(speed.min(), speed.max(), 160)
    fitted = 0.012 * np.tanh(grid / 4.0)
    term = MissingTerm(
        "mechanical", "missing torque", "N m", "speed", "rad/s", speed, torque,
        grid, fitted, fitted - 4e-4, fitted + 4e-4, "coulomb_friction",
    )  # fmt: skip
    voltage = MissingTerm(
        "electrical", "missing voltage", "V", "current", "A",
        run.measured_current, 0.02 * rng.standard_normal(speed.size),
    )  # fmt: skip
    smooth = signal.savgol_filter(torque, 101, 2)
    trace = MissingTrace(
        run.name, "missing torque", "N m", run.time, smooth, smooth - 8e-4, smooth + 8e-4
    )
    return SearchAccount(
        sentences=("The mechanical equation lacks a torque that opposes the motion.",),
        terms=(term, voltage),
        traces=(trace,),
        candidates=(
            CandidateRow("coulomb_friction", "mechanical", 0.93, -0.92, 0.991, "chosen"),
            CandidateRow(
                "viscous_temperature", "mechanical", 0.61, -0.55, 0.009, "alternative",
                "nearly as good below 60 °C",
            ),
            CandidateRow(
                "brush_drop", "electrical", 0.02, 0.01, 0.0, "ruled out",
                "not supported by the validation runs",
            ),
        ),
        remaining=("The residual is white noise.",),
    )  # fmt: skip


def make_report(rows: int = 1500, with_effect: bool = False) -> ReportData:
    """Data of a report, clean or with an effect, long or short."""
    roles = ["training"] * 5 + ["validation"] * 2
    runs = [_run(index, role, rows, with_effect) for index, role in enumerate(roles)]
    return ReportData(
        result=_result(runs, with_effect),
        runs=tuple(runs),
        coefficients=_coefficients(with_effect),
        steps=_steps(),
        posterior=_posterior(),
        account=_account(runs[5]) if with_effect else None,
        equations=tuple(printed_equations(MotorModel()).values()),
    )

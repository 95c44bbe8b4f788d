"""Temperature of runs without a logged temperature.

In training runs it is a parameter of the model (`model.unlogged`).  In validation runs it is fitted
with all parameters held, like the initial state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.initial import fitted_initial_states
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.model.excitation import Record
from identification.model.simulate import Simulator
from identification.model.unlogged import RAMP, Unlogged
from identification.model.weighting import Weighting
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = [
    "estimated_temperatures", "unlogged_of", "with_expected_temperatures", "with_own_temperatures",
    "with_scale_drawn",
]  # fmt: skip

_LEAST_SPAN: Final = 1.0
"""Range of logged temperatures below which they do not determine temperature coefficients [K]."""
_WIDEST: Final = 5.0
"""Half width of the search range around the expected temperature [prior standard deviations]."""
_LANES: Final = 16
_SHRINK: Final = 2.0 / (_LANES - 1)
"""Range of a grid over that of the one before [-]."""
_GRIDS: Final = 3
"""Grids of one round, the last 0.4 K apart; a parabola through its lowest three points follows.
Later rounds leave out the first."""
_ROUNDS: Final = 3
"""Rounds at most in which temperature, warming and initial state are fitted in turn, the others
held."""
_STILL: Final = 1e-3
"""Move [prior standard deviations] below which a round is the last."""


def unlogged_of(records: Sequence[Record]) -> Unlogged:
    """Unlogged temperatures that a fit to the records has to estimate."""
    unknown = {record.run: record.expected for record in records if record.expected is not None}
    if not unknown:
        return Unlogged()
    logged = [record.column("temperature") for record in records if record.expected is None]
    span = float(np.ptp(np.concatenate(logged))) if logged else 0.0
    runs = tuple(sorted(unknown))
    reference = None if logged else runs[0]
    return Unlogged(runs, unknown[runs[0]], reference, span < _LEAST_SPAN)


def with_own_temperatures(
    model: MotorModel,
    values: Array,
    records: Sequence[Record],
    deviation: Array,
    *,
    whole: bool = False,
) -> tuple[Record, ...]:
    """Records with a fitted temperature where none was logged, one per run.

    The values are (n_parameter,) physical and held, the noise of current and speed is (2,) [A,
    rad/s].  Initial states are fitted to whole records if `whole`, as an unknown phase requires.
    """
    if model.unlogged.is_relative and len(model.unlogged.runs) == 1:
        # A single training run without a log gives no reference; a temperature fitted here would
        # hide what the model lacks.
        return with_expected_temperatures(records)
    found = {
        run: _temperature(model, values, [r for r in records if r.run == run], deviation, whole)
        for run in sorted({record.run for record in records if record.expected is not None})
    }
    return tuple(_at(record, found.get(record.run)) for record in records)


def with_expected_temperatures(records: Sequence[Record]) -> tuple[Record, ...]:
    """Records with the expected temperature throughout where none was logged."""
    return tuple(
        record if record.expected is None else _at(record, np.array([0.0, record.expected]))
        for record in records
    )


def _temperature(
    model: MotorModel, values: Array, records: Sequence[Record], deviation: Array, whole: bool
) -> Array:
    """(2,) warming over one run [K] and temperature in its middle [degC]."""
    free = replace(model, unlogged=Unlogged((records[0].run,), float(records[0].expected or 0.0)))
    known = dict(zip([p.name for p in model.parameters], values, strict=True))
    unlogged = free.unlogged.parameters
    known |= {parameter.name: parameter.prior_mean for parameter in unlogged}
    at = [k for k, p in enumerate(free.parameters) if p in unlogged]
    tried = np.repeat([[known[p.name]] for p in free.parameters], _LANES, axis=1)
    records = tuple(records)
    weighting = replace(Weighting.white(records), deviation=deviation)
    scale = np.array([own.scale for own in unlogged])
    substeps, states = None, None
    for attempt in range(_ROUNDS):
        before = tried[at, 0]
        here = tuple(_at(record, before) for record in records)
        start = Simulator.fitting(model, here, values, substeps)
        states = fitted_initial_states(start, values, deviation, whole=whole, start=states)
        simulator = Simulator.fitting(free, records, tried[:, 0], substeps)
        simulator = simulator.roughly_accurate(tried[:, 0], states, deviation)
        substeps = simulator.substeps
        for row, own in reversed(list(zip(at, unlogged, strict=True))):
            for grid in range(min(attempt, 1), _GRIDS):
                middle, half = tried[row, 0], _WIDEST * own.scale * _SHRINK**grid
                lanes = np.linspace(middle - half, middle + half, _LANES)
                tried[row] = np.clip(lanes, own.lower, own.upper)
                sums = simulator.misfit(tried, states, weighting)
                with np.errstate(over="ignore", invalid="ignore"):
                    cost = 0.5 * np.sum(sums / deviation[:, None] ** 2, axis=0)
                    cost += 0.5 * ((tried[row] - own.prior_mean) / own.scale) ** 2
                lowest = _lowest(tried[row], cost)
                tried[row] = middle if lowest is None else lowest
        if np.all(np.abs(tried[at, 0] - before) < _STILL * scale):
            break
    return np.asarray(tried[at, 0])


def _lowest(at: Array, cost: Array) -> float | None:
    """Minimum of a cost over a grid, by a parabola; None if no cost is finite."""
    if not np.isfinite(cost).any():
        return None
    k = int(np.nanargmin(cost))
    step, around = np.diff(at[max(k - 1, 0) : k + 2]), cost[max(k - 1, 0) : k + 2]
    if step.size < 2 or not np.isclose(*step) or not np.isfinite(around).all():
        return float(at[k])
    bend = around[0] - 2.0 * around[1] + around[2]
    return float(at[k] + 0.5 * step[0] * (around[0] - around[2]) / bend if bend > 0.0 else at[k])


def _at(record: Record, own: Array | None) -> Record:
    """The record with a given warming and mid-run temperature; unchanged if it has a log."""
    if own is None or record.expected is None:
        return record
    columns = {}
    for name in ("temperature", "temperature_next"):
        passed = (record.column(name) - record.expected) / RAMP
        columns[name] = own[1] + own[0] * passed
    return record.with_inputs(columns)


def estimated_temperatures(fit: Fit, unseen: Sequence[Record]) -> dict[str, float]:
    """Estimated mid-run temperatures of runs without a log, by the name of the run [degC]."""
    values = fit.by_name
    names = {record.run: record.name for record in fit.simulator.records}
    found = {}
    for run in fit.simulator.model.unlogged.runs:
        name = f"temperature_of_run_{run + 1}"
        if name in values:
            found[names[run]] = values[name]
    late = [record for record in unseen if record.expected is not None]
    return found | {r.name: float(np.mean(r.column("temperature"))) for r in late}


def with_scale_drawn(draws: dict[str, Array], fit: Fit, seed: int) -> dict[str, Array]:
    """Draws by name with alpha_Ra, if it was held, replaced by draws from its prior.

    Without a span of logged temperatures, the runs determine the ratio of the two temperature
    coefficients, not their size.  Resistance and torque constant at the expected temperature stay
    unchanged.  A coefficient that the user knows was not held, and its draws are unchanged.
    """
    unlogged = fit.simulator.model.unlogged
    held = fit.coordinates.parameters[fit.coordinates.names.index("alpha_Ra")]
    if not unlogged.is_relative or held.origin:
        return draws
    (own,) = [p for p in MotorModel().parameters if p.name == "alpha_Ra"]
    rng = np.random.default_rng([seed, 1])
    changed = dict(draws)
    normal = rng.standard_normal(draws["alpha_Ra"].shape)
    changed["alpha_Ra"] = own.prior_mean + own.prior_sd * own.scale * normal
    changed["alpha_Kt"] = draws["alpha_Kt"] * changed["alpha_Ra"] / draws["alpha_Ra"]
    heat = unlogged.expected - REFERENCE_TEMPERATURE_DEGC
    for size, slope in (("Ra25", "alpha_Ra"), ("Kt25", "alpha_Kt")):
        before, after = (1 + each[slope] * heat for each in (draws, changed))
        changed[size] = draws[size] * np.where(after > 0, before / np.maximum(after, 1e-300), 1.0)
    return changed

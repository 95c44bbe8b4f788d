"""Linear model of the deviation from the simulation under a missing voltage and torque.

A missing voltage e_v and a missing torque e_tau are added to the right-hand sides of the two
balances.  To first order, the deviation from the fitted simulation then obeys

    d(t + h) = A d(t) + B e(t),      residual = C d(t) + T dp + noise

A, B and C are the derivatives of the simulated step itself, so they are exact for a linear motor
with any electrical time constant.  The disturbances e are held over a sample interval, like the
voltage.  T is the derivative of the simulation with respect to the parameters, which are uncertain.

The disturbances are an ordinary term of the model (`term.py`), so the physics is implemented only
once.  Delayed channels are used without their delay: a delay of a few samples shifts the trace by
as much and does not change the intensities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.fit.own_states import state_precision
from identification.fit.solve import Fit
from identification.linear import least_squares
from identification.model.blocks import BLOCK, blocks
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record, sample_interval
from identification.model.parameter import Parameter
from identification.model.scan import LANES, scan_of
from identification.model.step import advance
from identification.model.substeps import Substeps
from identification.model.tangent import tangent_blocks
from identification.model.term import (
    AbstractDelay,
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)

__all__ = ["Deviation", "Piece", "Structure", "deviation_of"]


class Disturbance(AbstractTorque, AbstractVoltage):
    """Missing voltage and torque, held over a sample interval."""

    name = "disturbance"
    drivers = ()
    parameters = (
        Parameter("voltage", "V", "missing voltage"),
        Parameter("torque", "N m", "missing torque"),
    )

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return values.voltage

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return values.torque


@dataclass(frozen=True)
class Structure:
    """Entries of A, B and C: which are constant and which vary from row to row."""

    shape: int
    """Number of states."""
    fixed: tuple[float | None, ...]
    """For each entry of [A, B, C'], column by column, its constant value, or None if it varies."""
    tangents: int
    """Number of uncertain parameters."""

    def matrices(self, entries: Expression) -> tuple[Expression, Expression, Expression]:
        """A (n, n), B (n, 2) and C (2, n) from the varying entries."""
        n, varying = self.shape, 0
        whole: Expression = ca.SX(n, n + 4)
        for k, value in enumerate(self.fixed):
            if value is None:
                whole[k % n, k // n] = entries[varying]
                varying += 1
            elif value != 0.0:
                whole[k % n, k // n] = value
        return whole[:, :n], whole[:, n : n + 2], whole[:, n + 2 :].T


@dataclass(frozen=True)
class Piece:
    """One record, or a segment of it, in the units of the filter."""

    record: Record
    entries: Array
    """(n_sample, n_changing) varying entries of A, B and C."""
    targets: Array
    """(n_sample, 2, 1 + n_tangent) residual and its derivatives by the parameters."""
    weight: Array
    """(n_sample, 2) divisor of the noise variance; zero where the sensor was clipped."""
    spread: Array
    """(n_state,) variance of the deviation at the first sample."""

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.targets.shape[0])

    def part(self, start: int, stop: int) -> Piece:
        """A segment of the rows, with the initial variance of the whole piece."""
        rows = slice(start, stop)
        entries, targets, weight = self.entries[rows], self.targets[rows], self.weight[rows]
        return replace(self, entries=entries, targets=targets, weight=weight)


@dataclass(frozen=True)
class Deviation:
    """Linear model of the deviation over all records.

    Channels are divided by `noise` and disturbances by `scale`, so that every number in the filter
    is of order one for any motor.
    """

    structure: Structure
    pieces: tuple[Piece, ...]
    """One per record."""
    noise: Array
    """(2,) unit of current and speed [A, rad/s]."""
    scale: Array
    """(2,) unit of missing voltage and torque: a constant disturbance of this size shifts a channel
    by about its noise [V, N m]."""
    interval: float
    """Median sample interval [s]."""
    precision: Array
    """(n_tangent,) inverse prior variance of the parameters."""
    offset: Array
    """(n_tangent,) prior mean of the parameters, relative to the linearisation."""


def deviation_of(fit: Fit, position: Array | None = None) -> Deviation:
    """Linearise a simulation in states, disturbances and parameters (search coordinates).

    `position` (n_parameter,) holds the search coordinates of the simulation; those of the fit if
    None.
    """
    if position is not None:
        simulator = fit.simulator.changed_to(fit.simulator.model, fit.coordinates.values(position))
        fit = replace(fit, position=position, simulator=simulator)
    simulator, noise = fit.simulator, _noise_unit(fit)
    spreads = [1.0 / state_precision(simulator, k) for k in range(len(simulator.records))]
    own = np.sqrt(np.mean(spreads, axis=0))[2:]
    units = np.concatenate([noise, own])
    n = fit.position.size
    bare, rows = _linearised(fit)
    scale = _scale(Structure(units.size, bare, n), rows, noise)
    structure, rows = _in_units(Structure(units.size, bare, n), rows, (units, scale, noise))
    slopes = fit.coordinates.slopes(fit.position)
    targets = [np.empty((record.rows, 2, 1 + n)) for record in simulator.records]
    for block in tangent_blocks(simulator, fit.values, fit.states, np.diag(slopes)):
        part = targets[block.record][block.samples]
        measured = simulator.records[block.record].measured[block.samples]
        part[:, :, 0] = (measured - block.logged) / noise
        part[:, :, 1:] = block.tangent[:, :, :n] / noise[:, None]
    pieces = []
    for k, record in enumerate(simulator.records):
        spread = spreads[k] / units**2
        weight = np.where(record.weight > 0, 1.0, 0.0)
        pieces.append(Piece(record, rows[k], targets[k], weight, spread))
    prior = 1.0 / fit.coordinates.prior_sd**2
    offset = np.where(prior > 0, fit.coordinates.prior_mean - fit.position, 0.0)
    interval = sample_interval(simulator.records)
    return Deviation(structure, tuple(pieces), noise, scale, interval, prior, offset)


def _noise_unit(fit: Fit) -> Array:
    """(2,) approximate noise of both channels; 1 for a channel without a finite estimate."""
    found = np.maximum(fit.weighting.deviation, fit.weighting.floor)
    return np.where(np.isfinite(found) & (found > 0), found, 1.0)


def _linearised(fit: Fit) -> tuple[tuple[float | None, ...], list[Array]]:
    """Constant entries of A, B and C', and for each record the varying ones (n_sample, k)."""
    simulator = fit.simulator
    kept = [term for term in simulator.model.terms if not isinstance(term, AbstractDelay)]
    model = replace(simulator.model, terms=(*kept, Disturbance()))
    n, size = len(model.state_names), len(model.parameters)
    x, u, p = ca.SX.sym("x", n), ca.SX.sym("u", len(INPUTS)), ca.SX.sym("p", size - 2)
    pushed = ca.SX.sym("e", 2)
    everything = ca.vertcat(p, pushed)
    following = advance(model, simulator.plan, x, u, everything)
    logged = model.logged(x, u, everything)
    whole = ca.horzcat(
        ca.jacobian(following, x), ca.jacobian(following, pushed), ca.jacobian(logged, x).T
    )
    whole = ca.simplify(ca.densify(ca.substitute(whole, pushed, ca.SX.zeros(2))))
    entries = [whole[k % n, k // n] for k in range(n * (n + 4))]
    fixed = tuple(float(entry) if entry.is_constant() else None for entry in entries)
    if simulator.substeps is not None:
        # The matrices of the substeps are multiplied, so no entry is certain to stay constant.
        fixed = (None,) * len(entries)
    moving = [entry for entry, value in zip(entries, fixed, strict=True) if value is None]
    step = ca.Function(
        "linearised",
        [x, u, p],
        [ca.substitute(following, pushed, ca.SX.zeros(2)), ca.vertcat(*moving)],
    )
    values = _without_delays(simulator.model, fit.values)[:, None]
    scan = scan_of(step)
    found = [np.empty((record.rows, len(moving))) for record in simulator.records]
    for k, rows in enumerate(found):
        carry = fit.states[k][:, None]
        # A pass writes whole blocks of lanes, so a block has as many rows fewer.
        for _, (part,) in blocks([len(rows)], simulator.inputs[k].shape[0], most=BLOCK // LANES):
            inputs, _ = simulator.stretch(k, part)
            (carry,), (out,) = scan([inputs], values, [carry])
            if simulator.substeps is None:
                rows[part] = out[:, :, 0]
            else:
                rows[part] = _composed(out[:, :, 0], n, simulator.substeps[k].of(part))
    return fixed, found


def _composed(parts: Array, n: int, substeps: Substeps) -> Array:
    """Entries over whole sample intervals from those of their substeps; all entries vary."""
    begins, counts = substeps.first_rows, substeps.counts
    whole = parts[begins].copy()
    matrices = parts.reshape(-1, n + 4, n).transpose(0, 2, 1)
    total = whole.reshape(-1, n + 4, n).transpose(0, 2, 1)
    for part in range(1, int(counts.max())):
        rows = np.flatnonzero(counts > part)
        step = matrices[begins[rows] + part]
        moved = step[:, :, :n] @ total[rows, :, : n + 2]
        moved[:, :, n:] += step[:, :, n : n + 2]
        total[rows, :, : n + 2] = moved
    return np.asarray(whole)


def _without_delays(model: MotorModel, values: Array) -> Array:
    """Parameter values without those of delays."""
    late = {f"{t.name}.{p.name}" for t in model.delays for p in t.parameters}
    kept = [parameter.name not in late for parameter in model.parameters]
    return np.asarray(values[kept])


def _scale(structure: Structure, rows: Sequence[Array], noise: Array) -> Array:
    """(2,) missing voltage and torque that shift the steady state by the noise [V, N m]."""
    middle = np.median(np.concatenate(rows), axis=0)
    a, b, c = (np.asarray(ca.DM(m)) for m in structure.matrices(ca.DM(middle)))
    steady = c @ least_squares(np.eye(a.shape[0]) - a, b, 1e-9)
    reach = np.abs(steady / noise[:, None]).max(axis=0)
    return np.asarray(1.0 / np.where(reach > 0, reach, 1.0))


def _in_units(
    structure: Structure, rows: list[Array], units: tuple[Array, Array, Array]
) -> tuple[Structure, list[Array]]:
    """Structure and rows with states, disturbances and channels divided by their units."""
    states, scale, noise = units
    dynamic = np.concatenate([states, scale])[:, None] / states
    flat = np.concatenate([dynamic.ravel(), ((1.0 / noise)[:, None] * states).ravel()])
    fixed = tuple(
        None if value is None else float(value * factor)
        for value, factor in zip(structure.fixed, flat, strict=True)
    )
    moving = flat[[value is None for value in fixed]]
    changed = Structure(structure.shape, fixed, structure.tangents)
    for each in rows:
        each *= moving
    return changed, rows

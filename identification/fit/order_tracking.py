"""Order tracking: drift of an angle that is integrated from the logged speed.

The integral of white noise of the speed is a Wiener process, so the integrated angle phi drifts
from the true angle by delta, with increments of variance

    var(delta(t + d) - delta(t)) = sigma_w^2 h d,                           [rad^2]

where sigma_w is the noise of the speed and h the sample interval.  In autocorrelated noise, sigma_w
is the slow noise: that of white noise with the same power at frequency zero.  A torque of order k
turns the drift into a phase error k delta.  After a few seconds it exceeds a period and the torque
vanishes from the average over the record, although it is large in each part of it.

The torque itself shows the drift.  In blocks so short that the phase error within one is small, its
two amplitudes follow from linear least squares with the simulated responses to a sine and a cosine.
The argument of the two amplitudes is the phase error of the block.  Its variance depends on the
speed, because a fast shaft hardly shows the torque.  The phases are unwrapped outwards from the
most accurate block and smoothed with the random walk as prior.  The result corrects the angle of
the record.

Source: Vold and Leuridan, SAE paper 931288 (1993) (order tracking as estimation of a slowly varying
complex amplitude); Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, Wiley (2001), section 8.6 (smoothing).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from identification.arrays import Array
from identification.model.composite import MotorModel
from identification.model.excitation import Record, sample_interval
from identification.model.simulate import Simulator
from identification.model.term import AbstractTerm

__all__ = [
    "block_edges",
    "block_products",
    "is_tracked",
    "path_penalty",
    "tracked",
]

_COARSE: Final = 0.5
"""Variance of the phase error within a block whose phase is unknown [rad^2]."""
_FINE: Final = 0.02
"""The same once the phase is known up to small errors [rad^2]."""
_NEGLIGIBLE: Final = 0.02
"""Variance of the phase error over a record that lowers an amplitude by half a per cent [rad^2]."""
_STEP: Final = 0.01
"""Step of the finite differences, relative to the scale of the torque or one radian [-]."""
_NO_RESPONSE: Final = 1e-12
"""Information below which a block shows nothing of the amplitudes, over that of their scale [-]."""
_INTENSITIES: Final = (1.0, 4.0, 16.0, 64.0)
"""Intensities of the random walk over that of the slow noise [-]."""
_FEWEST: Final = 10
"""Samples of a block at least."""
_PASSES: Final = 3
"""Corrections of the angle; the phase errors of a pass are those that the previous one left."""


def tracked(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    slow: float = 1.0,
) -> tuple[Simulator, tuple[Array, ...]]:
    """Simulator with corrected angles, and initial states with the amplitudes at these angles.

    Both are unchanged if no term of the model depends on an integrated angle.  The values are
    (n_parameter,) physical, the states (n_state,) for each record, the noise of current and speed
    is (2,) [A, rad/s].  `slow` is the slow noise of the speed over its noise [-].
    """
    term = _tracked_term(simulator)
    found = [state.copy() for state in states]
    if term is None or not np.all(deviation > 0):
        return simulator, tuple(found)
    order = _order(simulator, term, values)
    waves, size = _waves(simulator, term)
    for _ in range(_PASSES):
        before, records = simulator.records, list(simulator.records)
        for k, series in _all_series(simulator, values, found, deviation, slow):
            record = series.record
            if record.raw_angle is None:
                path, found[k][waves[0]] = _acquired(series, found[k][waves[0]], size)
            else:
                path = _improved(series, order, len(waves))
            records[k] = record.with_angle(record.integrated + path / order)
        if all(a is b for a, b in zip(records, before, strict=True)):
            break
        simulator = replace(simulator, records=tuple(records))
    return simulator, tuple(found)


def is_tracked(model: MotorModel) -> bool:
    """True if a term of the model depends on an angle that is corrected by tracking."""
    return any(term.tracked for term in model.terms)


def block_edges(record: Record, order: float, speed_noise: float) -> NDArray[np.int64]:
    """Edges (n_block + 1,) of blocks in which the phase of an order drifts little.

    The order is in periods per revolution [-], the noise of the speed in rad/s.
    """
    return _edges(record, order**2 * speed_noise**2 * sample_interval([record]), _COARSE)


def block_products(
    responses: Array, residual: Array, weight: Array, edges: NDArray[np.int64]
) -> tuple[Array, Array]:
    """For each block the normal matrix (n_lane, n_lane) and the right-hand side (n_lane,).

    Responses (n_sample, 2, n_lane) and residual (n_sample, 2) are in standard deviations of the
    noise, weights are (n_sample, 2); the edges (n_block + 1,) are the first samples of the blocks
    and the number of samples.
    """
    weighted = responses * weight[:, :, None]
    matrix = np.einsum("nci,ncj->nij", weighted, responses)
    right = np.einsum("nci,nc->ni", weighted, residual)
    return np.add.reduceat(matrix, edges[:-1]), np.add.reduceat(right, edges[:-1])


def path_penalty(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    slow: float,
    fraction: float,
) -> float:
    """Reduction of the log evidence by the paths of the phase [log likelihood].

    Half the log determinant of the posterior over the prior information of the random walk, and
    half the squared increments, at the intensity with the largest evidence (MacKay, Neural
    Computation 4 (1992), 415-447).  The samples count by the effective fraction [-].
    """
    term = _tracked_term(simulator)
    if term is None or all(record.raw_angle is None for record in simulator.records):
        return 0.0
    order = _order(simulator, term, values)
    penalties = np.zeros(len(_INTENSITIES))
    for _, series in _all_series(simulator, values, states, deviation, slow):
        if series.record.raw_angle is not None:
            faster = [replace(series, walk=factor * series.walk) for factor in _INTENSITIES]
            penalties += [one.penalty(order, len(term.tracked), fraction) for one in faster]
    return float(penalties.min())


def _tracked_term(simulator: Simulator) -> AbstractTerm | None:
    return next((term for term in simulator.model.terms if term.tracked), None)


def _order(simulator: Simulator, term: AbstractTerm, values: Array) -> float:
    names = [parameter.name for parameter in simulator.model.parameters]
    return float(values[names.index(f"{term.name}.order")])


def _waves(simulator: Simulator, term: AbstractTerm) -> tuple[list[list[int]], float]:
    """Places of the amplitudes in the state, a pair for each harmonic, and their scale."""
    places = {name: k for k, name in enumerate(simulator.model.state_names)}
    waves = [[places[f"{term.name}.{name}"] for name in pair] for pair in term.tracked]
    return waves, next(s.scale for s in term.states if s.name == term.tracked[0][0])


def _all_series(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    deviation: Array,
    slow: float,
) -> Iterator[tuple[int, _Series]]:
    """Number and series of each record whose angle drifts enough to be corrected."""
    term = _tracked_term(simulator)
    if term is None:
        return
    order = _order(simulator, term, values)
    moves = [_moves(state, *_waves(simulator, term)) for state in states]
    lanes = [np.column_stack([s, s[:, None] + m]) for s, m in zip(states, moves, strict=True)]
    logged = simulator.logged(np.repeat(values[:, None], lanes[0].shape[1], axis=1), lanes)
    for k, record in enumerate(simulator.records):
        walk = order**2 * (slow * deviation[1]) ** 2 * sample_interval([record])
        if record.angle_logged or walk * _duration(record) < _NEGLIGIBLE:
            continue
        residual = (record.measured - logged[k][:, :, 0]) / deviation
        moved = (logged[k][:, :, 1:] - logged[k][:, :, :1]) / (_STEP * deviation[:, None])
        if np.isfinite(np.concatenate([residual[:, :, None], moved], axis=2)).all():
            yield k, _Series(record, walk, residual, moved)


def _edges(record: Record, walk: float, variance: float) -> NDArray[np.int64]:
    """Edges of blocks in which the phase error grows by at most `variance` [rad^2]."""
    blocks = int(min(walk * _duration(record) / variance, record.rows / _FEWEST)) + 1
    return np.linspace(0, record.rows, blocks + 1).astype(np.int64)


@dataclass(frozen=True)
class _Series:
    """Residual and responses of one record, in standard deviations of the noise."""

    record: Record
    walk: float
    """Variance of the phase error per time [rad^2/s]."""
    residual: Array
    """(n_sample, 2)."""
    responses: Array
    """(n_sample, 2, 3) to a change of the sine and of the cosine by their scale, and to a change of
    the phase by one radian."""

    def blocks(self, edges: NDArray[np.int64], lanes: slice) -> tuple[Array, Array]:
        """For each block the normal matrix and the right-hand side of some responses."""
        return block_products(self.responses[:, :, lanes], self.residual, self.record.weight, edges)

    def fine(self, harmonics: int) -> tuple[Array, Array, Array]:
        """Middles of fine blocks [s], and information and right-hand side of their phases."""
        edges = _edges(self.record, self.walk * harmonics**2, _FINE)
        matrix, right = self.blocks(edges, slice(2, 3))
        return _middles(self.record, edges), matrix[:, 0, 0], right[:, 0]

    def present(self, order: float, time: Array) -> Array:
        """Path of the phase at some times [rad]."""
        path = order * (self.record.column("angle") - self.record.integrated)
        return np.asarray(np.interp(time, self.record.time, path))

    def penalty(self, order: float, harmonics: int, fraction: float) -> float:
        """Share of the record in `path_penalty`."""
        time, precision, _ = self.fine(harmonics)
        if not precision.any():
            return 0.0
        diagonal, links = _chain(fraction * precision, time, self.walk)
        for k, link in enumerate(links):
            diagonal[k + 1] -= link**2 / diagonal[k]
        # The mean phase of the record is no part of the walk: its amplitudes contain it.
        whole = np.log(fraction * np.sum(precision))
        spread = np.sum(np.log(diagonal)) - np.sum(np.log(links)) - whole
        return 0.5 * float(spread + links @ np.diff(self.present(order, time)) ** 2)


def _acquired(series: _Series, amplitudes: Array, size: float) -> tuple[Array, Array]:
    """First path of a record, from the phases of coarse blocks, and the amplitudes at it.

    The present amplitudes of sine and cosine are (2,) [N m], `size` is their scale.  The path is
    the phase correction (n_sample,) [rad].
    """
    record, walk = series.record, series.walk
    edges = _edges(record, walk, _COARSE)
    matrix, right = series.blocks(edges, slice(2))
    information = np.maximum(0.5 * np.trace(matrix, axis1=1, axis2=2), 1e-300)
    # A block without any response keeps its amplitudes.
    ridge = (1e-9 * information + _NO_RESPONSE)[:, None, None] * np.eye(2)
    steps = np.linalg.solve(matrix + ridge, right[:, :, None])[:, :, 0]
    found = amplitudes / size + steps
    square = _mean_square(found, matrix, information)
    # A block in which the noise exceeds the amplitude shows no phase.
    precision = np.where(square * information > 1.0, square * information, 0.0)
    if not precision.any():
        return np.zeros(record.rows), amplitudes
    time = _middles(record, edges)
    phases = _unwrapped(np.arctan2(found[:, 1], found[:, 0]), precision, time, walk)
    path = _smoothed(phases, precision, time, walk)
    mean = float(np.average(path, weights=precision))
    turned = size * np.sqrt(square) * np.array([np.cos(mean), np.sin(mean)])
    return np.asarray(np.interp(record.time, time, path - mean)), turned


def _improved(series: _Series, order: float, harmonics: int) -> Array:
    """Path (n_sample,) after a Gauss-Newton step from the present one, with fine blocks [rad]."""
    record = series.record
    time, precision, right = series.fine(harmonics)
    if not precision.any():
        return series.present(order, record.time)
    step = np.divide(right, precision, out=np.zeros(precision.size), where=precision > 0)
    path = _smoothed(series.present(order, time) + step, precision, time, series.walk)
    return np.asarray(np.interp(record.time, time, path))


def _middles(record: Record, edges: NDArray[np.int64]) -> Array:
    """Times in the middle of blocks [s]."""
    middle = 0.5 * (edges[:-1] + edges[1:] - 1)
    return np.asarray(np.interp(middle, np.arange(record.rows), record.time))


def _mean_square(found: Array, matrix: Array, information: Array) -> float:
    """Mean square of the amplitude over the blocks, without what noise adds [N^2 m^2].

    Two amplitudes fitted to noise have an expected quadratic form of 2.
    """
    forms = np.einsum("bi,bij,bj->b", found, matrix, found)
    return max(float(np.sum(forms - 2.0) / np.sum(information)), 1e-300)


def _unwrapped(phases: Array, precision: Array, time: Array, walk: float) -> Array:
    """Phases (n_block,) with whole turns added, outwards from the most accurate block [rad].

    A Kalman filter of the random walk predicts each phase from its predecessors.
    """
    whole = phases.copy()
    first = int(np.argmax(precision))
    for sequence in (range(first + 1, phases.size), range(first - 1, -1, -1)):
        mean, variance, at = whole[first], 1.0 / precision[first], time[first]
        for k in sequence:
            variance += walk * abs(time[k] - at)
            at = time[k]
            whole[k] = mean + (phases[k] - mean + np.pi) % (2 * np.pi) - np.pi
            if precision[k] > 0:
                gain = variance / (variance + 1.0 / precision[k])
                mean += gain * (whole[k] - mean)
                variance *= 1.0 - gain
    return whole


def _smoothed(phases: Array, precision: Array, time: Array, walk: float) -> Array:
    """Most probable path (n_block,) of a random walk through phases of known precision [rad]."""
    if phases.size == 1:
        return phases
    diagonal, links = _chain(precision, time, walk)
    banded = np.vstack([np.concatenate([[0.0], -links]), diagonal])
    return np.asarray(solveh_banded(banded, precision * phases))


def _chain(precision: Array, time: Array, walk: float) -> tuple[Array, Array]:
    """Diagonal (n_block,) and links (n_block - 1,) of the information matrix of a path."""
    links = 1.0 / (walk * np.diff(time))
    diagonal = precision.copy()
    diagonal[:-1] += links
    diagonal[1:] += links
    return diagonal, links


def _moves(state: Array, waves: Sequence[Sequence[int]], size: float) -> Array:
    """(n_state, 3) small changes of sine, cosine and phase, for the responses to them.

    A change of the phase by d turns the amplitudes a, b of harmonic h by h d: a' = -h b, b' = h a.
    """
    moves = np.zeros((state.size, 3))
    for lane, column in enumerate(waves[0]):
        moves[column, lane] = _STEP * size
    for harmonic, (sine, cosine) in enumerate(waves, 1):
        moves[sine, 2] = -_STEP * harmonic * state[cosine]
        moves[cosine, 2] = _STEP * harmonic * state[sine]
    return moves


def _duration(record: Record) -> float:
    return float(record.time[-1] - record.time[0])

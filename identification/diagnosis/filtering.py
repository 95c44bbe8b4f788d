"""Augmented Kalman filter: likelihood of disturbance intensities, parameters integrated out.

The state of the filter has two disturbances and one slow noise process per channel:

    d      deviation of the motor's own states      d+   = A d + B (e + white voltage noise)
    e      missing voltage, missing torque          e+   = a e + w
    c      coloured part of each channel's noise    c+   = r c + w
    residual = C d + c + white noise + T dp

The processes e and c are first-order Gauss-Markov, with unknown intensities and correlation times.
The gains of the filter do not depend on data, so residual and parameter tangents pass through the
same gains side by side.  The likelihood with the parameters integrated out under their prior is
then a small least-squares problem in the innovations.  With fixed parameters, the part of a missing
torque that the fit has absorbed would appear as a missing voltage.

Each lane is one candidate set of intensities and correlation times.

Source: Kristensen, Madsen, Jorgensen, Computers & Chemical Engineering 28 (2004) 225-237; the
parameters by de Jong, Annals of Statistics 19 (1991) 1073-1083 (augmented filter).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.diagnosis.deviation import Deviation, Piece, Structure
from identification.linear import eigh
from identification.model.scan import Scan, scan_of

__all__ = [
    "HYPER",
    "Likelihood",
    "Symbols",
    "likelihood",
    "predicted",
    "rows_of",
    "started",
    "updated",
]

HYPER: Final = (
    "keep_voltage", "drive_voltage", "keep_torque", "drive_torque",
    "keep_current", "drive_current", "keep_speed", "drive_speed",
    "white_current", "white_speed", "supply",
)  # fmt: skip
"""Hyperparameters of one candidate: for each of the four slow processes the factor from sample to
sample and the variance of the driving noise, then the variances of the white noise of current,
speed and voltage; all in the units of `Deviation`."""


@dataclass(frozen=True)
class Likelihood:
    """Marginal likelihood of each lane and the posterior of the parameters."""

    value: Array
    """(n_lane,) log likelihood with the parameters integrated out, up to a constant."""
    shift: Array
    """(n_lane, n_tangent) posterior mean of the parameters, relative to the linearisation."""
    covariance: Array
    """(n_lane, n_tangent, n_tangent) their posterior covariance."""


@dataclass(frozen=True)
class Symbols:
    """Symbolic Kalman filter of one structure."""

    structure: Structure

    @property
    def size(self) -> int:
        """Number of filter states."""
        return self.structure.shape + 4

    @property
    def triangle(self) -> list[tuple[int, int]]:
        """Indices of the covariance entries that are stored (lower triangle)."""
        return [(i, j) for i in range(self.size) for j in range(i + 1)]

    def full(self, packed: ca.SX) -> ca.SX:
        """(size, size) symmetric matrix from its packed lower triangle."""
        whole = ca.SX(self.size, self.size)
        for k, (i, j) in enumerate(self.triangle):
            whole[i, j] = packed[k]
            whole[j, i] = packed[k]
        return whole

    def packed(self, whole: ca.SX) -> ca.SX:
        """Packed lower triangle of a symmetric matrix."""
        return ca.vertcat(*[whole[i, j] for i, j in self.triangle])

    def symmetric(self, whole: ca.SX) -> ca.SX:
        """Matrix with the lower triangle of another one in both triangles."""
        return self.full(self.packed(whole))

    def row(self, further: int = 0) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Entries, targets (2, n_column) and weights (2,) of a row, and hyperparameters of a lane.

        In the smoother, `further` values of a lane select its target column.
        """
        return (
            ca.SX.sym("f", self.structure.fixed.count(None)),
            ca.SX.sym("y", 2, 1 + self.structure.tangents),
            ca.SX.sym("w", 2),
            ca.SX.sym("h", len(HYPER) + further),
        )

    def transition(self, entries: ca.SX, hyper: ca.SX) -> ca.SX:
        """(size, size) transition matrix of the filter state."""
        n = self.structure.shape
        a, b, _ = self.structure.matrices(entries)
        whole = ca.SX(self.size, self.size)
        whole[:n, :n] = a
        whole[:n, n : n + 2] = b
        for k in range(4):
            whole[n + k, n + k] = hyper[2 * k]
        return whole

    def seen(self, entries: ca.SX) -> list[ca.SX]:
        """For each channel the observation row (1, size) from the filter state to the residual."""
        n = self.structure.shape
        c = self.structure.matrices(entries)[2]
        rows = []
        for channel in range(2):
            row = ca.SX(1, self.size)
            row[0, :n] = c[channel, :]
            row[0, n + 2 + channel] = 1
            rows.append(row)
        return rows


def predicted(
    symbols: Symbols, mean: ca.SX, covariance: ca.SX, entries: ca.SX, hyper: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Time update: mean (size, n_column) and covariance one sample later."""
    n = symbols.structure.shape
    f = symbols.transition(entries, hyper)
    moved = ca.mtimes(ca.mtimes(f, covariance), f.T)
    b = symbols.structure.matrices(entries)[1][:, 0]
    moved[:n, :n] += hyper[10] * ca.mtimes(b, b.T)
    for k in range(4):
        moved[n + k, n + k] += hyper[2 * k + 1]
    return ca.mtimes(f, mean), symbols.symmetric(moved)


def updated(
    row: ca.SX, mean: ca.SX, covariance: ca.SX, target: ca.SX, weight: ca.SX, white: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Measurement update by one channel.

    Return mean, covariance, innovations (1, n_column) and inverse innovation variance.

    The variance of the white noise is divided by the weight; at weight zero the state is unchanged.
    """
    gain = ca.mtimes(covariance, row.T)
    inverse = weight / (weight * ca.mtimes(row, gain) + white)
    innovation = target - ca.mtimes(row, mean)
    return (
        mean + ca.mtimes(gain, innovation) * inverse,
        covariance - _square(gain, inverse),
        innovation,
        inverse,
    )


def _square(column: ca.SX, factor: ca.SX) -> ca.SX:
    """The matrix factor column column', with identical expressions in both triangles."""
    lower = ca.tril(ca.mtimes(column, (column * factor).T))
    return lower + ca.tril(lower, False).T


def started(deviation: Deviation, piece: Piece, hyper: Array) -> Array:
    """(n_triangle, n_lane) covariance before the first sample."""
    symbols = Symbols(deviation.structure)
    n = symbols.structure.shape
    lanes = hyper.shape[1]
    diagonal = [index for index, (i, j) in enumerate(symbols.triangle) if i == j]
    packed = np.zeros((len(symbols.triangle), lanes))
    packed[diagonal[:n]] = piece.spread[:, None]
    packed[diagonal[n:]] = hyper[1:8:2] / np.maximum(1.0 - hyper[0:8:2] ** 2, 1e-300)
    return packed


@lru_cache(32)
def _filter_scan(structure: Structure) -> Scan:
    """Filter loop; carries packed covariance, means, innovation products and log variances."""
    symbols = Symbols(structure)
    columns = 1 + structure.tangents
    packed = ca.SX.sym("P", len(symbols.triangle))
    means = ca.SX.sym("m", symbols.size, columns)
    pairs = [(i, j) for i in range(columns) for j in range(i + 1)]
    before, logs = ca.SX.sym("s", len(pairs)), ca.SX.sym("l")
    entries, targets, weight, hyper = symbols.row()
    mean, covariance, sums, product = means, symbols.full(packed), before, ca.SX(1)
    for channel, row in enumerate(symbols.seen(entries)):
        white = hyper[8 + channel]
        spread = ca.mtimes(ca.mtimes(row, covariance), row.T)
        product *= weight[channel] * spread + white
        mean, covariance, z, inverse = updated(
            row, mean, covariance, targets[channel, :], weight[channel], white
        )
        scaled = z * inverse
        sums = sums + ca.vertcat(*[scaled[i] * z[j] for i, j in pairs])
    mean, covariance = predicted(symbols, mean, covariance, entries, hyper)
    step = ca.Function(
        "filter",
        [
            ca.vertcat(packed, ca.vec(means), before, logs),
            ca.vertcat(entries, ca.vec(targets), weight),
            hyper,
        ],
        [
            ca.vertcat(symbols.packed(covariance), ca.vec(mean), sums, logs + ca.log(product)),
            ca.SX(0, 1),
        ],
    )
    return scan_of(step, effort="some")


def likelihood(deviation: Deviation, pieces: Sequence[Piece], hyper: Array) -> Likelihood:
    """Log likelihood of hyperparameters (n_hyper, n_lane) with the parameters integrated out.

    The pieces, records or segments of them, are treated as independent.
    """
    structure = deviation.structure
    symbols, columns = Symbols(structure), 1 + structure.tangents
    lanes = hyper.shape[1]
    pairs = columns * (columns + 1) // 2
    own = len(symbols.triangle) + symbols.size * columns
    carries, rows = [], []
    for piece in pieces:
        zeros = np.zeros((symbols.size * columns + pairs + 1, lanes))
        carries.append(np.concatenate([started(deviation, piece, hyper), zeros]))
        rows.append(rows_of(piece))
    finals, _ = _filter_scan(structure)(rows, hyper, carries)
    sums, logs = np.zeros((pairs, lanes)), np.zeros(lanes)
    for final, piece in zip(finals, pieces, strict=True):
        sums += final[own : own + pairs]
        # A sample of zero weight has added the logarithm of its white noise variance; subtract it.
        absent = np.sum(piece.weight == 0.0, axis=0)
        logs += final[own + pairs] - absent @ np.log(hyper[8:10])
    return _integrated(deviation, sums, logs)


def rows_of(piece: Piece) -> Array:
    """Input rows of the filter: entries, targets by column, weights."""
    flat = piece.targets.transpose(0, 2, 1).reshape(piece.rows, -1)
    return np.column_stack([piece.entries, flat, piece.weight])


def _integrated(deviation: Deviation, sums: Array, logs: Array) -> Likelihood:
    """Marginal likelihood from the summed innovation products of residual and tangents.

    The innovation of residual minus tangents times shift is linear in the shift.  The posterior of
    the shift is therefore normal, and its covariance is the inverse of sum z z' / s + prior.
    """
    n = deviation.structure.tangents
    lanes = logs.size
    products = np.empty((lanes, n + 1, n + 1))
    pairs = [(i, j) for i in range(n + 1) for j in range(i + 1)]
    for (i, j), values in zip(pairs, sums, strict=True):
        products[:, i, j] = products[:, j, i] = values
    prior = deviation.precision
    with np.errstate(invalid="ignore"):
        matrix = products[:, 1:, 1:] + np.diag(prior)
        right = products[:, 1:, 0] + prior * deviation.offset
        constant = products[:, 0, 0] + prior @ deviation.offset**2
    size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2), 1e-300))
    scaled = matrix / (size[:, :, None] * size[:, None, :])
    finite = np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(logs) & np.isfinite(constant)
    value = np.full(lanes, -np.inf)
    shift, covariance = np.zeros((lanes, n)), np.zeros((lanes, n, n))
    if finite.any():
        values, vectors = eigh(scaled[finite])
        values = np.maximum(values, 1e-12)
        inverse = np.einsum("aij,aj,akj->aik", vectors, 1.0 / values, vectors)
        inverse /= size[finite][:, :, None] * size[finite][:, None, :]
        best = np.einsum("aij,aj->ai", inverse, right[finite])
        gained = np.einsum("ai,ai->a", best, right[finite])
        determinant = np.log(values).sum(axis=1) + 2 * np.log(size[finite]).sum(axis=1)
        value[finite] = -0.5 * (logs[finite] + constant[finite] - gained + determinant)
        shift[finite], covariance[finite] = best, inverse
    return Likelihood(value, shift, covariance)

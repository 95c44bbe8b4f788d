"""Expected information of a run about parameters and about the index of the model.

Parameters.  With the covariance C = R R' before and the Fisher information F of the run, the
covariance after is R (1 + R' F R)^-1 R', and the expected information is half the logarithm of the
determinant of 1 + R' F R (Bayesian D-optimality).

Models.  Each model m predicts the readings y with the mean u_m and the covariance
S_m = 1 + G_m C_m G_m' in units of the noise.  With the Bhattacharyya distances

    B_ij = (u_i - u_j)' S^-1 (u_i - u_j) / 8 + log(det S / sqrt(det S_i det S_j)) / 2,
    S = (S_i + S_j) / 2,

the Kullback-Leibler divergences D_ij and the probabilities p_i, the mutual information of the
index of the model and the readings is between

    -sum_i p_i log sum_j p_j exp(-B_ij)   and   -sum_i p_i log sum_j p_j exp(-D_ij),

and the most probable model is the wrong one with a probability of at most
sum_{i<j} sqrt(p_i p_j) exp(-B_ij).

All models lie in the span of a few vectors, in which the distances are computed exactly.

Source: Lindley, Annals of Mathematical Statistics 27 (1956), 986-1005; Chaloner and Verdinelli,
Statistical Science 10 (1995), 273-304 (parameters); Atkinson and Fedorov, Biometrika 62 (1975),
57-70 (T-optimality, the distance at known parameters); Kailath, IEEE Trans. Communication
Technology 15 (1967), 52-60 (Bhattacharyya distance, bound of the error); Kolchinsky and Tracey,
Entropy 19 (2017), 361 (bounds of the mutual information).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.design.response import Response
from identification.linear import eigh, root

__all__ = ["Separation", "information_bits", "narrowed", "separation"]


def narrowed(covariance: Array, information: Array) -> Array:
    """Covariance (n, n) after a run, from that before it and the run's Fisher information."""
    half = root(covariance)
    values, vectors = eigh(np.eye(half.shape[0]) + half.T @ information @ half)
    rotated = half @ vectors
    return np.asarray((rotated / np.maximum(values, 1.0)) @ rotated.T)


def information_bits(covariance: Array, information: Array) -> float:
    """Expected information about the parameters [bit]; the arguments are those of `narrowed`."""
    half = root(covariance)
    values = eigh(np.eye(half.shape[0]) + half.T @ information @ half)[0]
    return float(0.5 * np.sum(np.log2(np.maximum(values, 1.0))))


@dataclass(frozen=True)
class Separation:
    """Expected separation of several models by one run."""

    least_bits: float
    """Lower bound of the mutual information of model index and readings [bit]."""
    most_bits: float
    """Upper bound of it [bit]."""
    wrong: float
    """Upper bound of the probability that the most probable model is the wrong one [-]."""
    log_odds: Array
    """(n_model, n_model) expected log Bayes factor of the true model i over j [nat]."""
    closeness: float
    """Negative logarithm of `wrong`, before rounding to zero [bit]."""


def separation(responses: Sequence[Response], probability: Sequence[float]) -> Separation:
    """Expected separation of models over a run, from their probabilities before it [-]."""
    p = np.asarray(probability, dtype=np.float64)
    means, covariances = _reduced(responses)
    count = len(means)
    near, far = np.zeros((count, count)), np.zeros((count, count))
    factors = [np.linalg.cholesky(covariance) for covariance in covariances]
    sizes = [2.0 * float(np.sum(np.log(np.diag(factor)))) for factor in factors]
    for i in range(count):
        for j in range(count):
            if i == j:
                continue
            apart = means[i] - means[j]
            # Divergence of j from i: how the readings of i speak against j.
            white = np.linalg.solve(factors[j], np.column_stack([factors[i], apart]))
            far[i, j] = 0.5 * (np.sum(white**2) - apart.size + sizes[j] - sizes[i])
            middle = np.linalg.cholesky(0.5 * (covariances[i] + covariances[j]))
            size = 2.0 * float(np.sum(np.log(np.diag(middle))))
            distance = np.sum(np.linalg.solve(middle, apart) ** 2) / 8.0
            near[i, j] = distance + 0.5 * (size - 0.5 * (sizes[i] + sizes[j]))
    pairs = [
        0.5 * np.log(p[i] * p[j]) - near[i, j] for i in range(count) for j in range(i + 1, count)
    ]
    log_wrong = float(np.logaddexp.reduce(pairs))
    return Separation(
        least_bits=_mutual(p, near),
        most_bits=_mutual(p, far),
        wrong=float(np.exp(min(log_wrong, np.log(0.5)))),
        log_odds=far,
        closeness=-log_wrong / np.log(2.0),
    )


def _mutual(p: Array, distance: Array) -> float:
    """Mutual information from pairwise distances [bit]."""
    inner = np.logaddexp.reduce(np.log(p)[None, :] - distance, axis=1)
    return float(-np.sum(p * inner) / np.log(2.0))


def _reduced(responses: Sequence[Response]) -> tuple[list[Array], list[Array]]:
    """Means and covariances in an orthonormal basis of all sensitivities and differences."""
    first = responses[0].mean
    columns = [response.sensitivity for response in responses]
    columns += [(response.mean - first)[:, None] for response in responses[1:]]
    basis = np.linalg.qr(np.concatenate(columns, axis=1))[0]
    means, covariances = [], []
    for response in responses:
        own = basis.T @ response.sensitivity
        spread = own @ root(response.covariance)
        means.append(basis.T @ (response.mean - first))
        covariances.append(np.eye(basis.shape[1]) + spread @ spread.T)
    return means, covariances

"""Terms found by PySINDy in a campaign of the bench simulator.

    python -m benchmarks.peers.sindy CAMPAIGN

The weak form of Reinbold et al., which PySINDy recommends for noisy data, needs no derivative.  The
library holds the terms of the nominal model and one term for each law in the comparison; voltage
and temperature are control inputs.  The threshold of sequentially thresholded least squares (STLSQ)
is scanned over normalised columns, and the model with the least Bayesian information criterion on
the validation run is taken, separately for each equation.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
import pysindy
from numpy.typing import NDArray

from benchmarks.peers.campaigns import load
from benchmarks.peers.child import Stopwatch, report

__all__ = ["TERMS", "found_terms", "main"]

Array = NDArray[np.float64]

_TESTS: Final = 400
"""Test functions of the weak form in each run."""
_HALF_WIDTH: Final = 10
"""Half width of a test function [samples]."""
_THRESHOLDS: Final = np.geomspace(1e-4, 0.3, 25)

TERMS: Final[dict[str, Any]] = {
    "v": lambda i, w, v, t: v,
    "i": lambda i, w, v, t: i,
    "w": lambda i, w, v, t: w,
    "t i": lambda i, w, v, t: t * i,
    "t w": lambda i, w, v, t: t * w,
    "1": lambda i, w, v, t: np.ones_like(np.asarray(i)),
    "sgn w": lambda i, w, v, t: np.sign(w),
    "w |w|": lambda i, w, v, t: w * np.abs(w),
    "sgn i": lambda i, w, v, t: np.sign(i),
    "i |i|": lambda i, w, v, t: i * np.abs(i),
    "|i| w": lambda i, w, v, t: np.abs(i) * w,
}
"""Candidate terms; `t` is the temperature above 25 degC over 100 K."""

_NOMINAL: Final = ("v", "i", "w", "t i", "t w")


def _inputs(run: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Time, states (n_sample, 2) and control inputs (n_sample, 2).

    The voltage is held between samples; the mean of both sides of a sample centres it for the
    quadrature of the weak form.
    """
    states = np.stack([run["current_A"], run["speed_rad_s"]], axis=1)
    voltage = run["voltage_V"]
    centred = 0.5 * (voltage + np.concatenate([voltage[:1], voltage[:-1]]))
    inputs = np.stack([centred, (run["temperature_degC"] - 25.0) / 100.0], axis=1)
    return run["time_s"], states, inputs


def _system(run: dict[str, Array]) -> tuple[Array, Array]:
    """Weak-form library (n_test, n_term) and left sides (n_test, 2) of one run."""
    time, states, inputs = _inputs(run)
    functions = pysindy.CustomLibrary(
        library_functions=list(TERMS.values()),
        function_names=[lambda *_, name=name: name for name in TERMS],
    )
    library = pysindy.WeakPDELibrary(
        functions, spatiotemporal_grid=time, K=_TESTS, H_xt=[_HALF_WIDTH * (time[1] - time[0])],
        derivative_order=0,
    )  # fmt: skip
    np.random.seed(0)  # noqa: NPY002  the library places its test functions by it
    both = pysindy.AxesArray(
        np.concatenate([states, inputs], axis=1), {"ax_time": 0, "ax_coord": 1}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own arrays with axes
        columns = library.fit_transform(both)
        left = library.convert_u_dot_integral(both)
    return np.asarray(columns), np.asarray(left)[:, :2]


def found_terms(
    training: list[dict[str, Array]], validation: list[dict[str, Array]]
) -> list[list[str]]:
    """Terms beyond the nominal model, for the current's and the speed's equation.

    A nominal term in the other equation, such as the voltage in the torque balance, is not counted.

    Args:
        training: Runs to fit, by channel.
        validation: Runs that choose the threshold.
    """
    fitted, unseen = _stacked(training), _stacked(validation)
    return [
        [name for name in _chosen(fitted, unseen, equation) if name not in _NOMINAL]
        for equation in range(2)
    ]


def _stacked(runs: list[dict[str, Array]]) -> tuple[Array, Array]:
    """Weak form of all runs together."""
    systems = [_system(run) for run in runs]
    return np.concatenate([each[0] for each in systems]), np.concatenate(
        [each[1] for each in systems]
    )


def _chosen(fitted: tuple[Array, Array], unseen: tuple[Array, Array], equation: int) -> list[str]:
    """Terms of the threshold with the least Bayesian information criterion on `unseen`."""
    left = fitted[1][:, equation : equation + 1]
    best: tuple[float, list[str]] = (np.inf, [])
    for threshold in _THRESHOLDS:
        optimizer = pysindy.STLSQ(
            threshold=float(threshold * np.linalg.norm(left)), alpha=0.0, normalize_columns=True
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a threshold that removes all terms
            optimizer.fit(fitted[0], left)
        weights = np.asarray(optimizer.coef_)[0]
        error = unseen[1][:, equation] - unseen[0] @ weights
        kept = [name for name, weight in zip(TERMS, weights, strict=True) if weight != 0.0]
        criterion = error.size * np.log(np.mean(error**2)) + len(kept) * np.log(error.size)
        if criterion < best[0]:
            best = (float(criterion), kept)
    return best[1]


def main() -> None:
    """Find the terms and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("campaign", type=Path)
    chosen = parser.parse_args()
    training, validation, _ = load(chosen.campaign)
    watch = Stopwatch()
    with watch.timed("terms"):
        electrical, mechanical = found_terms(training, validation)
    named = [f"{term} (voltage)" for term in electrical]
    named += [f"{term} (torque)" for term in mechanical]
    report({**watch.line(), "named": named}, ("pysindy", "numpy"))


if __name__ == "__main__":
    main()

"""Goals of the comparison with their measured values, and the rules of fairness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from benchmarks.peers.statistics import Line, agreement, of, rates

__all__ = ["METHOD", "PROGRAMS", "goals"]

_MOST_OFF: Final = 4.0
"""Largest of nine normal deviates; exceeded once in two thousand comparisons."""

METHOD: Final = (
    "The data are {runs} runs of a servo motor whose electrical time constant is 3.3 sample "
    "intervals, with white noise of 1 % of each signal.\n"
    "All samplers have the same likelihood, priors and unknown noise deviations, and start from "
    "draws of the same normal approximation.\n"
    "They stop when the least bulk effective sample size (ESS, ArviZ) over the nine dimensions "
    "reaches 1,000, or after two minutes; motorid stops by its own rule, 50 autocorrelation "
    "times.\n"
    "The peers receive the optimum, its covariance and the response of the initial states from "
    "motorid at no cost.\n"
    "Each measurement is a process; peak memory is its largest resident set, with all "
    "imports.\n"
    "The first call, mostly compilation, has its own column and is in no other number.\n"
    "Rates count the time after warm-up and burn-in, or with warm-up all of the time after the "
    "first call.\n"
)

PROGRAMS: Final = (
    "- `emcee, loop`: emcee's stretch move on the numba loop of `benchmarks/handwritten.py`, 32 "
    "walkers on all cores; `DE` is the mixture of differential evolution and snooker moves that "
    "its documentation recommends.\n"
    "- `emcee, lanes`: the same moves on the hand-tuned kernel of "
    "`benchmarks/peers/kernels.py`, which simulates 32 walkers in vector instructions; 128 "
    "walkers fill its lanes.\n"
    "- `NUTS`: numpyro on a JAX scan with reverse-mode gradients in double precision; four "
    "vectorised chains in standardised coordinates, 200 steps of warm-up for the step size.\n"
    "- `scipy` and `pyPESTO`: residuals and exact forward sensitivities in numba, from a guess "
    "with errors of 20 to 50 %, divided by the true noise deviations; motorid has neither guess "
    "nor noise. `ls_trf` is the trust region method on residuals, `L-BFGS-B` the default of "
    "pyPESTO. Its fides optimizer is published without wheels, so the lock file cannot contain "
    "it.\n"
    "- `PySINDy`: weak form, thresholded least squares on normalised columns, threshold by the "
    "Bayesian information criterion of the validation run; its library holds the true law of "
    "each hidden effect and ten others.\n"
)


def goals(lines: Sequence[Line]) -> Iterator[tuple[str, str, str]]:
    """Goal, measured value, and yes or no."""
    for rows in sorted({line["rows"] for line in of(lines, "posterior")}):
        ours = of(lines, "posterior", "motorid", rows)
        for words, names, least in (
            ("emcee on the hand-written loop", ("emcee, loop", "emcee DE, loop"), 20.0),
            ("emcee on the hand-tuned kernel", ("emcee, lanes", "emcee DE, lanes"), 20.0),
            ("NUTS", ("NUTS",), 1.0),
        ):
            theirs = [some for name in names if (some := of(lines, "posterior", name, rows))]
            if ours and theirs:
                ratio = rates(ours) / max(rates(some) for some in theirs)
                whole = rates(ours, "wall_s_with_warm_up") / max(
                    rates(some, "wall_s_with_warm_up") for some in theirs
                )
                yield (
                    f"effective samples a second over those of {words}, {rows:,} rows: "
                    f"{least:g} or more",
                    f"{ratio:.3g} (processor), {whole:.3g} (wall, with warm-up)",
                    _yes(min(ratio, whole) >= least),
                )
        for name in ("emcee, lanes", "emcee DE, lanes", "NUTS"):
            for line in of(lines, "posterior", name, rows)[:1] if ours else ():
                off = agreement(line, ours[0])
                yield (
                    f"the same posterior means as {name}, {rows:,} rows: at most {_MOST_OFF:g} "
                    "Monte Carlo standard deviations",
                    f"{off:.1f}",
                    _yes(off <= _MOST_OFF),
                )
    for line in of(lines, "loop", rows=1_000_000):
        seconds, memory = line["wall"]["loop"], line["peak_mb"] / 1024.0
        yield (
            "whole loop of 1,000,000 rows on two cores: 300 s, 4 GB",
            f"{seconds:.0f} s, {memory:.2f} GB",
            _yes(seconds < 300.0 and memory < 4.0),
        )
    for line in of(lines, "kernels"):
        for model, ratio in line["ratios"].items():
            words = "dry friction" if model == "friction" else "the nominal model"
            yield (
                f"arithmetic with {words} over that of the hand-tuned kernel: at most 2",
                f"{ratio:.2f}",
                _yes(ratio <= 2.0),
            )


def _yes(reached: bool) -> str:  # noqa: FBT001  a verdict
    return "yes" if reached else "**no**"

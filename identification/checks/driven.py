"""Detection of a shaft that another machine drives, as in the test of the voltage constant.

With open terminals and an external drive, the speed rises without current, and the voltage is that
of a generator, v = Kt w.  The model has no machine that drives the shaft: by

    J (w2 - w1) <= Kt int i dt        while the speed rises

a passive load gains no more momentum than the current gives it.  J and Kt are those of the other
runs; a factor of ten between both sides allows for another load in this run.

Source of the test: IEEE Std 113-1985 (test procedures for direct-current machines), no-load
generator test.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from identification.checks.consistency import Estimate
from identification.checks.finding import Finding, refusal
from identification.ingest.run import Run

__all__ = ["driven_findings"]

_SHARE: Final = 0.1
"""Share of the momentum that the current gives, below which another machine drives the shaft."""
_GENERATED: Final = 0.2
"""Largest RMS difference between voltage and Kt w, over the RMS voltage, of a generator."""
_RISEN: Final = 0.5
"""Least rise of the speed over its largest magnitude."""


def driven_findings(runs: Sequence[Run], estimates: Sequence[Estimate]) -> Iterator[Finding]:
    """Findings for runs whose speed rises without current, by the estimates of the others."""
    sound = [one for one in estimates if one.is_sound and one.inertia > 0.0]
    for run in runs:
        others = [one for one in sound if one.run is not run]
        if not others:
            continue
        constant = float(np.median([one.constant for one in others]))
        inertia = float(np.median([one.inertia for one in others]))
        given = _share_of_momentum(run, constant, inertia)
        generated = run.voltage - constant * run.speed
        missed = float(np.linalg.norm(generated)) / max(float(np.linalg.norm(run.voltage)), 1e-300)
        if not (given < _SHARE and missed < _GENERATED):
            continue
        constant = abs(float(run.voltage @ run.speed)) / float(run.speed @ run.speed)
        yield refusal(
            "driven_shaft",
            run,
            "current_A",
            "the speed rises without current, and the voltage is that of a generator: another "
            "machine drives the shaft, or the current sensor is not connected; omit the run, and "
            f"if the terminals were open, give what it shows: --known Kt25={constant:.4g}",
            ("momentum given by the current over the gained momentum", given, _SHARE),
            option="known",
        )


def _share_of_momentum(run: Run, constant: float, inertia: float) -> float:
    """Momentum that the current gives during the largest rise of the speed, over the gain [-].

    Infinite if the speed falls for the most part, as that of a motor that coasts.
    """
    speed = np.abs(run.speed)
    last = int(np.argmax(speed - np.minimum.accumulate(speed)))
    first = int(np.argmin(speed[: last + 1]))
    rise = float(speed[last] - speed[first])
    if not rise > _RISEN * float(speed.max(initial=0.0)):
        return np.inf
    during = slice(first, last + 1)
    steps = 0.5 * (run.current[during][1:] + run.current[during][:-1]) * np.diff(run.time[during])
    charge = np.concatenate([[0.0], np.cumsum(steps)])
    return constant * float(np.ptp(charge)) / (inertia * rise)

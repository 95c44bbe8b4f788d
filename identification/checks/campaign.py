"""All checks of all runs, in an order in which the first explanation of a fault is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.checks.balance import Signals, balances_of, has_signal, signals_of
from identification.checks.between_samples import aliased_findings
from identification.checks.consistency import consistency_findings, estimate_of
from identification.checks.dead import copied_findings, dead_findings, stuck_findings
from identification.checks.finding import Finding
from identification.checks.heat import heat_findings, jump_findings
from identification.checks.identity import identity_findings
from identification.checks.magnitude import magnitude_findings
from identification.checks.noise import unlogged_voltage_findings
from identification.checks.plausible import plausibility_findings
from identification.checks.shift import shifted_findings
from identification.ingest.run import Run

__all__ = ["Verdict", "check_runs"]

_UNEXPLAINED = 0.6
_DRIVEN = 0.05


@dataclass(frozen=True)
class Verdict:
    """Findings of all checks."""

    findings: tuple[Finding, ...]
    """Contradictions first, then suspicions."""

    @property
    def refused(self) -> tuple[Finding, ...]:
        """Findings that block a fit."""
        return tuple(f for f in self.findings if f.severity == "refuse")

    @property
    def suspected(self) -> tuple[Finding, ...]:
        """Findings that are only reported."""
        return tuple(f for f in self.findings if f.severity == "suspect")


def check_runs(runs: Sequence[Run]) -> Verdict:
    """Check all runs of one motor, validation runs too, against physics and each other."""
    strongest = np.max([_sizes(run) for run in runs], axis=0) if runs else np.zeros(3)
    single = [_single(run, strongest) for run in runs]
    # A channel that is constant in all runs has no sensor; it is not fitted, and a warning says so.
    unmeasured = {
        column
        for column, word in (("current_A", "current"), ("speed_rad_s", "speed"))
        if all(np.ptp(getattr(run, word)) == 0.0 for run in runs)
    }
    found = [finding for one in single for finding in one if finding.column not in unmeasured]
    electrical = {f.file for f in found if f.column != "temperature_degC"}
    healthy = [run for run in runs if run.name not in electrical]
    estimates = [e for run in healthy if (e := estimate_of(run)) is not None]
    found += consistency_findings(estimates)
    odd = {f.file for f in found}
    agreeing = [e for e in estimates if e.run.name not in odd]
    if "" not in odd:
        found += heat_findings(agreeing)
    found += plausibility_findings(runs, agreeing)
    order = {"refuse": 0, "suspect": 1}
    return Verdict(tuple(sorted(found, key=lambda f: order[f.severity])))


def _sizes(run: Run) -> NDArray[np.float64]:
    """(3,) standard deviation of voltage, current and speed [V, A, rad/s]."""
    return np.array([np.std(run.voltage), np.std(run.current), np.std(run.speed)])


def _single(run: Run, strongest: NDArray[np.float64]) -> list[Finding]:
    """Findings of one run: temperature jumps, and the first electrical check that finds a fault."""
    jumps = jump_findings(run)
    moved = _sizes(run)
    if np.all(moved < _DRIVEN * strongest):
        return [*jumps, _idle(run, float(np.max(moved / strongest)))]
    signals = signals_of(run)
    if moved[0] < _DRIVEN * strongest[0]:
        return unlogged_voltage_findings(run, signals) + jumps
    for check in (
        copied_findings,
        aliased_findings,
        unlogged_voltage_findings,
        magnitude_findings,
        dead_findings,
        stuck_findings,
        shifted_findings,
        identity_findings,
        _unexplained,
    ):
        found = check(run, signals)
        if found:
            return found + jumps
    return jumps


def _idle(run: Run, share: float) -> Finding:
    return Finding(
        "idle_run",
        "suspect",
        run.name,
        None,
        "the motor hardly moves, so the run carries no information; omit it, or check that the "
        "drive was on",
        "standard deviation of the signals relative to the other runs",
        share,
        _DRIVEN,
    )


def _unexplained(run: Run, signals: Signals) -> list[Finding]:
    """Finding for a voltage that current and speed do not explain, for an unknown reason."""
    if not has_signal(signals.voltage):
        return []
    fits = [b.electrical for b in balances_of(signals)]
    missed = min((f.missed for f in fits if f is not None), default=0.0)
    if missed < _UNEXPLAINED:
        return []
    return [
        Finding(
            "unexplained_voltage",
            "refuse",
            run.name,
            "voltage_V",
            "current and speed do not explain it (v = R i + K w); check that all channels belong "
            "to one motor and one recording, and that it is the voltage at the motor terminals",
            "unexplained fraction of the voltage variance",
            missed,
            _UNEXPLAINED,
        )
    ]

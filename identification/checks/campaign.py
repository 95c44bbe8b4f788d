"""All checks of all runs, and the selection of the runs to fit: all, the consistent ones, or none.

The checks of one run have an order in which the first explanation of a fault is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Signals, has_signal, signals_of
from identification.checks.coasting import coastings_of
from identification.checks.computed import computed_findings
from identification.checks.consistency import consistency_findings, estimate_of
from identification.checks.dead import (
    copied_findings,
    dead_findings,
    stuck_findings,
    unlogged_voltage_findings,
)
from identification.checks.disconnected import disconnections_of
from identification.checks.discontinuous import discontinuous_findings
from identification.checks.driven import driven_findings
from identification.checks.finding import Finding, Omission, refusal, suspicion
from identification.checks.heat import heat_findings, jump_findings
from identification.checks.instants import aliased_findings, shifted_findings
from identification.checks.joined import divided, joined_finding, joints_of
from identification.checks.least_speed import least_speeds_of
from identification.checks.limited import current_limit_of, without
from identification.checks.lost_rows import lost_steps_of
from identification.checks.other_inertia import other_inertia_findings
from identification.checks.padded import padding_of
from identification.checks.plausible import plausibility_findings
from identification.checks.signs import identity_findings, magnitude_findings
from identification.checks.stalled import stalled_of
from identification.checks.supply import supply_current_findings
from identification.checks.wrapped import wrapped_findings
from identification.errors import ContradictoryRuns
from identification.ingest.run import Run
from identification.options import FitOptions
from identification.warning import ResultWarning, both_ways

__all__ = ["Admission", "Verdict", "admitted", "check_runs", "suspects"]

_UNEXPLAINED = 0.6
_DRIVEN = 0.05
_HELD = 2.0
"""RMS current at standstill over that of a turning run, from which the shaft is locked: breakaway
friction rarely exceeds twice that of a turning shaft."""

_FORCED: Final = (
    "do not rely on this result: it was fitted with --force (option force) although the runs "
    "contradict physics or each other: "
)
_ASIDE: Final = "run set aside (neither fitted nor used for validation): "
_SUSPECT: Final = ("identical_channels", "constant_channel")
"""Codes of warnings that may explain a failed calculation, the most likely first."""


@dataclass(frozen=True)
class Verdict:
    """Findings of all checks."""

    findings: tuple[Finding, ...]
    """Contradictions first, then suspicions."""
    runs: tuple[Run, ...] = ()
    """The checked runs, divided where recordings were joined or the drive limits the current."""

    @property
    def refused(self) -> tuple[Finding, ...]:
        """Findings that block a fit."""
        return tuple(f for f in self.findings if f.severity == "refuse")


def check_runs(runs: Sequence[Run]) -> Verdict:
    """Check all runs of one motor, validation runs too, against physics and each other."""
    strongest = np.max([_sizes(run) for run in runs], axis=0) if runs else np.zeros(3)
    omissions: list[Omission] = []
    for omissions_of in (
        _each(padding_of),
        _each(lost_steps_of),
        least_speeds_of,
        _each(_limit_of),
        disconnections_of,
        coastings_of,
        _each(stalled_of),
    ):
        pairs = list(zip(runs, omissions_of(runs), strict=True))
        runs = tuple(without(run, one.samples) if one else run for run, one in pairs)
        omissions += [one for _, one in pairs if one]
    joints = [(run, joints_of(run)) for run in runs]
    runs = tuple(divided(run, places) for run, places in joints)
    held = _currents_at_standstill(runs)
    single = [_single(run, strongest, ratio) for run, ratio in zip(runs, held, strict=True)]
    # A channel that is constant in all runs has no sensor; it is not fitted, and a warning says so.
    unmeasured = {
        column
        for column, word in (("current_A", "current"), ("speed_rad_s", "speed"))
        if all(np.ptp(getattr(run, word)) == 0.0 for run in runs)
    }
    found = [finding for one in single for finding in one if finding.column not in unmeasured]
    # The other runs decide on a sign that is only suspected.
    electrical = {
        f.file
        for f in found
        if f.column != "temperature_degC"
        and (f.code, f.severity) != ("reversed_channel", "suspect")
    }
    healthy = [run for run in runs if run.name not in electrical]
    estimates = [e for run in healthy if (e := estimate_of(run)) is not None]
    contradictions = [*driven_findings(healthy, estimates), *consistency_findings(estimates)]
    decided = {(f.code, f.file) for f in contradictions}
    found = [f for f in found if (f.code, f.file) not in decided] + contradictions
    odd = {f.file for f in found}
    agreeing = [e for e in estimates if e.run.name not in odd]
    if "" not in odd:
        found += heat_findings(agreeing)
    found += plausibility_findings(runs, agreeing)
    found += [joined_finding(run, places) for run, places in joints if places]
    found += [one.finding for one in omissions]
    order = {"refuse": 0, "suspect": 1}
    return Verdict(tuple(sorted(found, key=lambda f: order[f.severity])), runs)


def _limit_of(run: Run) -> Omission | None:
    """Limit of the current, unless a held voltage in its place looks like one."""
    limit = current_limit_of(run)
    return None if limit and any(identity_findings(run, signals_of(run))) else limit


def _each(
    omission_of: Callable[[Run], Omission | None],
) -> Callable[[Sequence[Run]], list[Omission | None]]:
    """Check of all runs that judges each of them alone."""
    return lambda runs: [omission_of(run) for run in runs]


def _sizes(run: Run) -> Array:
    """(3,) standard deviation of voltage, current and speed [V, A, rad/s]."""
    return np.array([np.std(run.voltage), np.std(run.current), np.std(run.speed)])


def _currents_at_standstill(runs: Sequence[Run]) -> list[float]:
    """RMS current of each run over that of the turning run with the least; 0 if it moves [-]."""
    speeds = np.array([np.std(run.speed) for run in runs])
    currents = np.sqrt([np.mean(run.current**2) for run in runs])
    turning = speeds > 0.5 * np.max(speeds, initial=0.0)
    least = np.min(currents, initial=np.inf, where=turning)
    stands = speeds < _DRIVEN * np.max(speeds, initial=0.0)
    return [float(ratio) for ratio in np.where(stands, currents / max(least, 1e-300), 0.0)]


def _single(run: Run, strongest: Array, held: float) -> list[Finding]:
    """Findings of one run: temperature jumps, and the first electrical check that finds a fault.

    `held` is the current of a run at standstill over that of a turning run; zero if it turns.
    """
    jumps = list(jump_findings(run))
    moved = _sizes(run)
    if np.all(moved < _DRIVEN * strongest):
        share = float(np.max(moved / strongest))
        idle = suspicion(
            "idle_run",
            run,
            None,
            "the motor hardly moves, so the run carries no information; omit it, or check that the "
            "drive was on",
            ("standard deviation of the signals relative to the other runs", share, _DRIVEN),
        )
        return [*jumps, idle]
    signals = signals_of(run)
    if moved[0] < _DRIVEN * strongest[0]:
        return [*unlogged_voltage_findings(run, signals), *jumps]
    for check in (
        copied_findings,
        computed_findings,
        wrapped_findings,
        aliased_findings,
        unlogged_voltage_findings,
        supply_current_findings,
        magnitude_findings,
        dead_findings,
        stuck_findings,
        shifted_findings,
        identity_findings,
        discontinuous_findings,
        _unexplained,
    ):
        found = list(check(run, signals))
        if found:
            return found + jumps
    if held <= _HELD:
        return jumps
    locked = refusal(
        "locked_shaft",
        run,
        "speed_rad_s",
        "the motor stands still with more current than another run needs to turn it: the shaft is "
        "locked, as in a stall test, or the speed sensor is not connected; omit the run",
        ("RMS current relative to the turning run with the least", held, _HELD),
    )
    return [*jumps, locked]


def _unexplained(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for a voltage that current and speed do not explain, for an unknown reason."""
    fits = [b.electrical for b in signals.balances]
    missed = min((f.missed for f in fits if f is not None), default=0.0)
    if missed >= _UNEXPLAINED and has_signal(signals.voltage):
        yield refusal(
            "unexplained_voltage",
            run,
            "voltage_V",
            "current and speed do not explain it (v = R i + K w); check that all channels belong "
            "to one motor and one recording, that it is the voltage at the motor terminals, and "
            "that the current is that of the motor and not of the supply",
            ("unexplained fraction of the voltage variance", missed, _UNEXPLAINED),
        )


@dataclass(frozen=True)
class Admission:
    """The runs to fit, and the findings of the checks."""

    training: tuple[Run, ...]
    validation: tuple[Run, ...]
    findings: tuple[Finding, ...] = ()
    """Findings in the given runs, contradictions first."""
    set_aside: tuple[tuple[Run, str], ...] = ()
    """Runs excluded for a contradiction, with their roles."""
    forced: bool = False
    """True if the runs to fit contain contradictions."""

    @property
    def warnings(self) -> list[ResultWarning]:
        """Warnings for the result, the most severe first."""
        left_out = {run.name for run, _ in self.set_aside}
        refused = [f for f in self.findings if f.severity == "refuse"]
        fitted = [f for f in refused if f.file not in left_out]
        forced = [f.warning(_FORCED, "critical") for f in fitted]
        aside = [f.warning(_ASIDE) for f in refused if f.file in left_out]
        # A contradiction of one channel is a warning of that channel, too, which names it first.
        named = [f.warning() for f in fitted if f.column]
        named += [f.warning() for f in self.findings if f.severity == "suspect"]
        return forced + aside + named


def admitted(training: Sequence[Run], validation: Sequence[Run], options: FitOptions) -> Admission:
    """Check all runs, decide which are fitted, and divide those that are joined recordings.

    Raises:
        ContradictoryRuns: Runs contradict physics or each other, and the options do not resolve it;
            the message lists all findings.
    """
    verdict = check_runs([*training, *validation])
    training, validation = verdict.runs[: len(training)], verdict.runs[len(training) :]
    findings = [*verdict.findings, *other_inertia_findings(training, validation)]
    left_out: set[str] = set()
    refused = verdict.refused
    while options.set_aside and (separable := {f.file for f in refused if f.separable}):
        left_out |= separable
        kept = [run for run in (*training, *validation) if run.name not in left_out]
        # A fault may have hidden another one, or have caused the contradictions of other runs.
        refused = check_runs(kept).refused
        known = {str(f) for f in findings}
        findings = [f for f in findings if f.separable or f in refused]
        findings += [f for f in refused if str(f) not in known]
    kept_training = tuple(run for run in training if run.name not in left_out)
    if (refused and not options.force) or (left_out and not kept_training):
        raise _refusal([f for f in findings if f.severity == "refuse"], options)
    aside = [(run, "training") for run in training if run.name in left_out]
    aside += [(run, "validation") for run in validation if run.name in left_out]
    return Admission(
        kept_training,
        tuple(run for run in validation if run.name not in left_out),
        tuple(findings),
        tuple(aside),
        forced=bool(refused),
    )


def _refusal(findings: Sequence[Finding], options: FitOptions) -> ContradictoryRuns:
    """Error that lists all findings and the possible remedies."""
    count = f"{len(findings)} contradictions" if len(findings) > 1 else "1 contradiction"
    ways = "correct the runs"
    if any(f.corrections for f in findings):
        ways += f" with {both_ways('map')}"
    if not options.set_aside and any(f.separable for f in findings):
        ways += f", exclude the named runs with {both_ways('set_aside')}"
    elif options.set_aside:
        ways += " (setting runs aside cannot resolve this, because too few runs remain)"
    text = "; ".join(f"({k}) {finding}" for k, finding in enumerate(findings, 1))
    return ContradictoryRuns(
        f"{count} in the runs; {ways}, or fit them anyway with {both_ways('force')}: {text}",
        [finding.entry() for finding in findings],
    )


def suspects(runs: Sequence[Run]) -> str:
    """Remarks on the runs that may explain why there is no result; empty if there are none."""
    found = [str(finding) for finding in check_runs(runs).refused]
    found += [str(w) for code in _SUSPECT for run in runs for w in run.warnings if w.code == code]
    if not found:
        return ""
    more = f" ({len(found) - 1} more such remarks)" if len(found) > 1 else ""
    return f"; what was noticed in the runs may be why: {found[0]}{more}"

"""Selection of the runs to fit after the checks: all, those without contradiction, or none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from identification.checks.campaign import check_runs
from identification.checks.finding import Finding
from identification.errors import ContradictoryRuns
from identification.ingest.run import Run
from identification.options import FitOptions
from identification.warning import ResultWarning, both_ways

__all__ = ["Admission", "admitted", "suspects"]

_FORCED: Final = (
    "do not rely on this result: it was fitted with --force (option force) although the runs "
    "contradict physics or each other: "
)
_ASIDE: Final = "run set aside (neither fitted nor used for validation): "
_SUSPECT: Final = ("identical_channels", "constant_channel")
"""Codes of warnings that may explain a failed calculation, the most likely first."""


@dataclass(frozen=True)
class Admission:
    """The runs to fit, and the findings of the checks."""

    training: tuple[Run, ...]
    """Runs to fit."""
    validation: tuple[Run, ...]
    """Validation runs."""
    findings: tuple[Finding, ...] = ()
    """Findings in the given runs, contradictions first."""
    set_aside: tuple[tuple[Run, str], ...] = ()
    """Runs excluded for a contradiction, with their roles."""
    forced: bool = False
    """True if the runs to fit contain contradictions."""

    @property
    def runs(self) -> tuple[Run, ...]:
        """Runs to fit, then validation runs."""
        return (*self.training, *self.validation)

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
    """Check all runs and decide which are fitted.

    Raises:
        ContradictoryRuns: Runs contradict physics or each other, and the options do not resolve it;
            the message lists all findings.
    """
    verdict = check_runs([*training, *validation])
    findings = list(verdict.findings)
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

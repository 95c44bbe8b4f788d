"""Checks of runs against physics and against each other, before anything is fitted.

    verdict = check_runs([*training, *validation])
    for finding in verdict.refused:
        print(finding)

Each check is a regression or a comparison of a few milliseconds; what it finds is a `Finding` with
the number that decided, and the words of ``--map`` that correct the run.
"""

from identification.checks.campaign import Verdict, check_runs
from identification.checks.finding import Finding

__all__ = ["Finding", "Verdict", "check_runs"]

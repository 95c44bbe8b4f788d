"""Checks of runs against physics and against each other, before any fit.

    verdict = check_runs([*training, *validation])
    for finding in verdict.refused:
        print(finding)

Each check is a regression or a comparison of a few milliseconds.  Its result is a `Finding` with
the deciding statistic and the ``--map`` argument that corrects the run.
"""

from identification.checks.campaign import Verdict, check_runs
from identification.checks.finding import Finding

__all__ = ["Finding", "Verdict", "check_runs"]

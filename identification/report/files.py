"""Files of a result directory: posterior.nc, result.json and report.html."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from identification.report.html import render_report
from identification.result.atomic import write_text
from identification.result.collect import report_data
from identification.result.entries import finite_or_null, write_result
from identification.result.findings import Findings
from identification.result.netcdf import write_posterior

__all__ = ["write_outputs"]


def write_outputs(directory: Path, result: dict[str, Any], findings: Findings) -> None:
    """Write posterior.nc if sampled, then result.json, then report.html.

    All numbers are on disk before anything is drawn.  A posterior or a report of an earlier fit is
    removed.
    """
    directory.mkdir(parents=True, exist_ok=True)
    posterior = directory / "posterior.nc"
    sample = findings.sample
    if sample is None:
        posterior.unlink(missing_ok=True)
    else:
        write_posterior(
            posterior,
            sample.names,
            sample.units,
            sample.chain,
            sample.log_density,
            acceptance=sample.convergence.acceptance,
            attributes={name: str(value) for name, value in result["software"].items()},
        )
    report = directory / "report.html"
    report.unlink(missing_ok=True)
    write_result(directory / "result.json", result)
    write_text(report, render_report(report_data(finite_or_null(result), findings)))

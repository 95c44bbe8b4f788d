"""Files of a result: posterior.nc, result.json and report.html."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from identification.errors import InputError
from identification.reporting.html import render_report
from identification.result.atomic import write_text
from identification.result.collect import report_data
from identification.result.draws import write_posterior
from identification.result.entries import finite_or_null, write_result
from identification.result.findings import Findings

__all__ = ["HasFindings", "report", "write_chain", "write_outputs", "write_report"]


class HasFindings(Protocol):
    """Fresh identification, of which a report can be drawn."""

    @property
    def result(self) -> dict[str, Any]:
        """Content of result.json."""

    @property
    def findings(self) -> Findings:
        """Findings of all stages."""


def write_outputs(directory: Path, result: dict[str, Any], findings: Findings) -> None:
    """Write posterior.nc if sampled, then result.json, then report.html.

    All numbers are on disk before anything is drawn.  A posterior or a report of an earlier fit is
    removed.
    """
    directory.mkdir(parents=True, exist_ok=True)
    posterior = directory / "posterior.nc"
    if not write_chain(posterior, result, findings):
        posterior.unlink(missing_ok=True)
    report = directory / "report.html"
    report.unlink(missing_ok=True)
    write_result(directory / "result.json", result)
    write_report(report, result, findings)


def write_chain(path: Path, result: Mapping[str, Any], findings: Findings) -> bool:
    """Write posterior.nc; return False, without a file, if the posterior was not sampled."""
    sample = findings.sample
    if sample is None:
        return False
    write_posterior(
        path,
        sample.names,
        sample.units,
        sample.chain,
        sample.log_density,
        acceptance=sample.convergence.acceptance,
        attributes={name: str(value) for name, value in result["software"].items()},
    )
    return True


def write_report(path: Path, result: dict[str, Any], findings: Findings) -> None:
    """Write the page for people."""
    today = datetime.now(tz=UTC).date().isoformat()
    write_text(path, render_report(report_data(finite_or_null(result), findings, today)))


def report(identification: HasFindings, path: str | os.PathLike[str] = "report.html") -> Path:
    """Write the report of an identification: one HTML page that needs no other file.

    Args:
        identification: What `identify` returns.
        path: File to write; its directory is created.

    Returns:
        The path.

    Raises:
        InputError: `identification` is something else, such as a stored result, whose report.html
            is in its directory.
    """
    if not hasattr(identification, "findings"):
        raise InputError(
            f"report needs what identify returns and has got a {type(identification).__name__}; "
            "the report of a stored result is the report.html in its directory"
        )
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_report(file, identification.result, identification.findings)
    return file

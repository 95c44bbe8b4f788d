"""HTML report as one self-contained file: it needs no server, no network and no other file.

    text = render_report(data)
    write_text(directory / "report.html", text)

The data for the script are in a block that is never executed.  `content_security_policy` returns
the policy of the page for an HTTP header.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from identification.reporting.columns import stored_runs
from identification.reporting.figures import curves
from identification.reporting.figures.chart import script_json
from identification.reporting.figures.corner import MOST_PARAMETERS, corner_figure
from identification.reporting.headline import (
    effect_tiles,
    error_bars,
    facts,
    headline_sentences,
    key_figures,
)
from identification.reporting.loops import loop_comparisons
from identification.reporting.page import asset, page_environment, page_policy
from identification.reporting.summary import further_sentences
from identification.reporting.tables import (
    error_rows,
    feedback_tables,
    parameter_rows,
    run_rows,
    sampler_rows,
)
from identification.reporting.warnings import warning_groups
from identification.result.attempts import Attempts, figure
from identification.result.entries import finite_or_null
from identification.result.report_data import ReportData, RunTraces
from identification.result.residuals import ResidualCheck, coloured_channels, residual_checks

__all__ = ["content_security_policy", "render_report"]

_SCRIPTS = ("vendor/uPlot.iife.min.js", "report.js")
_Panel = dict[str, Any]
"""Plot of a run: the stored columns that share one time axis."""

_RUNS_HERE = Markup("<!-- runs -->")
_LARGEST_PAGE = 1_950_000
"""Size that a page has at most if its tables and figures leave room for the runs [bytes]."""
_STYLES = ("vendor/uPlot.min.css", "report.css")


def render_report(data: ReportData) -> str:
    """Render the complete page; sections without data are omitted or reported as missing."""
    attempts = Attempts(list(data.undrawn))
    data = replace(data, result=finite_or_null(data.result))
    result, rows = data.result, attempts.rows
    checks = attempts.part("residual check", _checks_by_role, data.runs) or {}
    coloured = rows("whiteness", coloured_channels, next(iter(checks.values()), []))
    page = (
        _environment()
        .get_template("report.html.j2")
        .render(
            data=data,
            result=result,
            policy=content_security_policy(),
            scripts=_assets(_SCRIPTS),
            styles=_assets(_STYLES),
            facts=rows("facts", facts, data),
            sentences=rows("summary", headline_sentences, result, coloured),
            further=rows("summary of the data", further_sentences, result),
            effects=rows("effects", effect_tiles, data),
            bars=rows("errors", error_bars, result, coloured),
            key_figures=rows("key figures", key_figures, result),
            warnings=rows("warnings", warning_groups, result),
            parameters=rows("table of parameters", parameter_rows, data),
            runs=rows("table of runs", run_rows, data),
            runs_here=_RUNS_HERE,
            has_before=any(run.before_speed is not None for run in data.runs),
            checks=checks,
            temperatures=[run.temperature for run in data.runs if run.temperature is not None],
            feedback=rows("table of the loop", feedback_tables, result["feedback"]),
            suited=rows("loop that suits", feedback_tables, result.get("feedback_suited") or []),
            comparisons=rows("comparison of loops", loop_comparisons, result),
            sampler=rows("table of the sampler", sampler_rows, data),
            errors=rows("table of errors", error_rows, result),
            equations=[Markup(text) for text in data.equations],  # noqa: S704  escapes names
            undrawn=attempts.remarks,
        )
    )
    room = _LARGEST_PAGE - len(page.encode("utf-8"))
    return page.replace(
        _RUNS_HERE, "\n".join(rows("measured and simulated run", _payloads, data, room)), 1
    )


@cache
def content_security_policy() -> str:
    """Content security policy of a report: only its own scripts and styles, images as data URLs."""
    return page_policy(_assets(_STYLES), _assets(_SCRIPTS))


@cache
def _environment() -> Environment:
    environment = page_environment("identification.reporting")
    # Figures are drawn in the template; one that fails leaves a line of text in its place.
    environment.globals |= {
        "drawn": figure,
        "corner_figure": corner_figure,
        **{name: getattr(curves, name) for name in curves.__all__},
        "most_parameters": MOST_PARAMETERS,
    }
    return environment


def _assets(names: Sequence[str]) -> list[Markup]:
    return [asset("identification.reporting", name) for name in names]


def _payloads(data: ReportData, room: int) -> list[str]:
    """Data blocks for the script, one per run; all together take `room` bytes at most."""
    noise, blocks = data.result["noise"], []
    stored = stored_runs(data.runs, noise, room - 2000 * len(data.runs))
    for run, columns in zip(data.runs, stored, strict=True):
        content = {"name": run.name, "role": run.role, "panels": _panels(run, noise), **columns}
        start = f'<script type="application/json" class="run" data-role="{run.role}">'
        blocks.append(f"{start}{script_json(finite_or_null(content))}</script>")
    return blocks


def _panels(run: RunTraces, noise: Mapping[str, float | None]) -> list[_Panel]:
    panels = [
        *_channel("Speed", "rad/s", run.before_speed is not None, noise.get("speed_rad_s")),
        *_channel("Current", "A", run.before_current is not None, noise.get("current_A")),
        {"label": "Voltage [V]", "series": [_series("logged", "voltage", "voltage")]},
    ]
    if run.temperature is not None:
        logged = [_series("logged", "voltage", "temperature")]
        panels.append({"label": "Temperature [°C]", "series": logged})
    return panels


def _channel(name: str, unit: str, has_before: bool, noise: float | None) -> list[_Panel]:
    """Panels of a channel and of its residual."""
    key = name.lower()
    shown = [_series("measured", "trace", f"measured_{key}")]
    left = []
    if has_before:
        shown.append(_series("nominal model", "before", f"before_{key}"))
        left.append(_series("nominal model", "before", f"measured_{key}", f"before_{key}"))
    shown.append(_series("simulated", "after", f"after_{key}"))
    left.append(_series("final model", "after", f"measured_{key}", f"after_{key}"))
    return [
        {"label": f"{name} [{unit}]", "series": shown, "tall": True},
        {"label": f"{name} residual [{unit}]", "series": left, "noise": noise},
    ]


def _series(label: str, kind: str, column: str, minus: str = "") -> dict[str, str]:
    """A column, or the difference of two."""
    return {"label": label, "kind": kind, "column": column, "minus": minus}


def _checks_by_role(runs: Sequence[RunTraces]) -> dict[str, list[ResidualCheck]]:
    """Residual correlations of each role with sufficiently long runs, the deciding role first."""
    found = {
        role: residual_checks([run for run in runs if run.role == role])
        for role in ("validation", "training")
    }
    return {role: checks for role, checks in found.items() if checks}

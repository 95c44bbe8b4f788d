"""HTML report as one self-contained file: it needs no server, no network and no other file.

    text = render_report(data)
    write_text(directory / "report.html", text)

The template engine escapes all external text, the data for the script are in a block that is never
executed, and the content security policy admits only the page's own two scripts, by their hashes.
`content_security_policy` returns the same policy for an HTTP header.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from identification.report.figures.corner import MOST_PARAMETERS, corner_figure
from identification.report.figures.correlation import correlation_figure
from identification.report.figures.curves import coefficient_figure, step_figure
from identification.report.figures.missing import missing_over_time, missing_term_figure
from identification.report.figures.runs import run_thumbnail
from identification.report.figures.trace import trace_figure
from identification.report.loops import loop_comparisons
from identification.report.summary import key_figures, summary_sentences
from identification.report.tables import error_rows, feedback_tables, parameter_rows, run_rows
from identification.report.traces import run_payload
from identification.result.attempts import Attempts
from identification.result.entries import finite_or_null
from identification.result.numbers import (
    count_text,
    number_text,
    percent_text,
    probability_text,
    signed_percent_text,
    unit_text,
)
from identification.result.report_data import ReportData, RunTraces, StepResponse
from identification.result.residuals import (
    Correlation,
    ResidualCheck,
    coloured_channels,
    residual_checks,
)

__all__ = ["content_security_policy", "render_report"]

_SCRIPTS = ("vendor/uPlot.iife.min.js", "report.js")
_STYLES = ("vendor/uPlot.min.css", "report.css")
_NO_RUNS = Markup('{"runs":[]}')


def render_report(data: ReportData) -> str:
    """Render the complete page.

    Args:
        data: Data to show; missing sections are omitted or reported as missing.

    Returns:
        HTML text, UTF-8 when written.
    """
    attempts = Attempts(list(data.undrawn))
    data = replace(data, result=finite_or_null(data.result))
    result = data.result
    checks = attempts.part("residual check", lambda: _checks_by_role(data.runs)) or {}
    deciding = next(iter(checks.values()), [])
    coloured = attempts.rows("whiteness", lambda: coloured_channels(deciding))
    rows, figure = attempts.rows, attempts.figure
    return _environment().get_template("report.html.j2").render(
        data=data,
        result=result,
        policy=content_security_policy(),
        scripts=[_asset(name) for name in _SCRIPTS],
        styles=[_asset(name) for name in _STYLES],
        sentences=rows("summary", lambda: summary_sentences(result, coloured)),
        key_figures=rows("key figures", lambda: key_figures(result, coloured)),
        parameters=rows("table of parameters", lambda: parameter_rows(data)),
        runs=rows("table of runs", lambda: zip(run_rows(data), _thumbnails(data, attempts),
                                               strict=True)),
        payload=attempts.part("measured and simulated run", lambda: _payload(data)) or _NO_RUNS,
        has_before=any(run.before_speed is not None for run in data.runs),
        checks=_check_figures(checks, attempts),
        coefficients=_coefficient_figures(data, attempts),
        steps=[figure("step response", partial(step_figure, steps))
               for steps in _by_controller(data.steps)],
        confusions=data.confusions,
        feedback=rows("table of the loop", lambda: feedback_tables(result["feedback"])),
        comparisons=rows("comparison of loops", lambda: loop_comparisons(result)),
        errors=rows("table of errors", lambda: error_rows(result)),
        posterior=_posterior_figures(data, attempts),
        story=_story_figures(data, attempts),
        undrawn=attempts.remarks,
    )  # fmt: skip


@cache
def content_security_policy() -> str:
    """Content security policy of a report: only its own scripts and styles, images as data URLs.

    Returns:
        Value of the header ``Content-Security-Policy``.
    """
    scripts = " ".join(_hash(_asset(name)) for name in _SCRIPTS)
    styles = " ".join(_hash(_asset(name)) for name in _STYLES)
    return (
        f"default-src 'none'; script-src {scripts}; style-src {styles}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("identification.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number_text,
        "percent": percent_text,
        "probability": probability_text,
        "change": signed_percent_text,
        "count": count_text,
        "unit": unit_text,
        "words": lambda name: str(name).replace("_", " "),
    }
    return environment


@cache
def _asset(name: str) -> Markup:
    """Content of a file in the template folder, inserted unchanged into the page."""
    folder = resources.files("identification.report") / "templates"
    return Markup(folder.joinpath(name).read_text("utf-8"))


def _hash(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _payload(data: ReportData) -> Markup:
    """Time series for the script as JSON; escaping prevents a file name from ending its block."""
    noise = data.result["noise"]
    runs = [run_payload(run, len(data.runs), noise) for run in data.runs]
    text = json.dumps(
        finite_or_null({"runs": runs}), allow_nan=False, separators=(",", ":"), ensure_ascii=True
    )
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _checks_by_role(runs: Sequence[RunTraces]) -> dict[str, list[ResidualCheck]]:
    """Residual correlations of each role with sufficiently long runs, the deciding role first."""
    found = {
        role: residual_checks([run for run in runs if run.role == role])
        for role in ("validation", "training")
    }
    return {role: checks for role, checks in found.items() if checks}


def _thumbnails(data: ReportData, attempts: Attempts) -> list[Markup]:
    return [attempts.figure("run", partial(run_thumbnail, run)) for run in data.runs]


def _check_figures(
    checks_by_role: dict[str, list[ResidualCheck]], attempts: Attempts
) -> list[dict[str, Any]]:
    return [
        {
            "role": role,
            "figures": [
                _check_figure(check.channel, against, stage, correlation, attempts)
                for check in checks
                for against, before, after in (
                    ("", check.own_before, check.own),
                    ("voltage", check.voltage_before, check.voltage),
                )
                for stage, correlation in (("before", before), ("after", after))
                if correlation is not None
            ],
        }
        for role, checks in checks_by_role.items()
    ]


def _check_figure(
    channel: str, against: str, stage: str, correlation: Correlation, attempts: Attempts
) -> dict[str, Any]:
    title = (
        f"Cross-correlation of the {channel} residual with the {against}"
        if against
        else f"Autocorrelation of the {channel} residual"
    )
    drawing = partial(
        correlation_figure, title, correlation, "lag [samples]", is_before=stage == "before"
    )
    return {
        "title": title,
        "stage": stage,
        "outside": correlation.outside,
        "figure": attempts.figure(title, drawing),
    }


def _coefficient_figures(data: ReportData, attempts: Attempts) -> list[dict[str, Any]]:
    logged = [run.temperature for run in data.runs if run.temperature is not None]
    return [
        {
            "name": curve.name,
            "figure": attempts.figure(
                f"{curve.name} over temperature", partial(coefficient_figure, curve, logged)
            ),
        }
        for curve in data.coefficients
    ]


def _by_controller(steps: Sequence[StepResponse]) -> list[list[StepResponse]]:
    controllers = dict.fromkeys(step.controller for step in steps)
    return [[step for step in steps if step.controller == one] for one in controllers]


def _posterior_figures(data: ReportData, attempts: Attempts) -> dict[str, Any] | None:
    if data.posterior is None:
        return None
    count = len(data.posterior.names)
    return {
        "corner": attempts.figure("corner plot", partial(corner_figure, data.posterior)),
        "left_out": data.posterior.names[MOST_PARAMETERS:],
        "traces": [
            attempts.figure("trace", partial(trace_figure, data.posterior, index))
            for index in range(count)
        ],
    }


def _story_figures(data: ReportData, attempts: Attempts) -> dict[str, Any] | None:
    if data.story is None:
        return None
    return {
        "sentences": data.story.sentences,
        "terms": [
            (term, attempts.figure("missing term", partial(missing_term_figure, term)))
            for term in data.story.terms
        ],
        "traces": [
            (trace, attempts.figure("missing term over time", partial(missing_over_time, trace)))
            for trace in data.story.traces
        ],
        "candidates": data.story.candidates,
        "remaining": data.story.remaining,
    }

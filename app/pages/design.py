"""Page of the next run: form of the design, expected gain and the profile as a file."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Self
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from app.errors import FieldRefused, RunRefused
from app.fits.schemas import FitSummary
from app.http.dependencies import CallerDep, ServicesDep
from app.pages.rendering import help_prefix, page
from app.pages.views import fit_view
from app.texts import parts, sentence
from identification.errors import InputError

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_LONGEST: Final = 200
_WIDE: Final = 920.0
"""Width of a figure that spans the page [drawing units]."""


@dataclass(frozen=True)
class DesignForm:
    """Fields of the form, as typed."""

    narrow: str = ""
    """Quantity to narrow; empty for all parameters."""
    limits: str = ""
    """Limits, ``NAME=VALUE,...``."""
    temperature: str = ""
    """Temperatures [degC], separated by commas or blanks."""
    duration: str = ""
    """Duration [s]."""
    rate: str = ""
    """Sample rate [Hz]."""

    @classmethod
    def of(cls, given: Mapping[str, str]) -> Self:
        """Build the form from the query of an address."""
        names = cls.__dataclass_fields__
        return cls(**{k: given[k].strip()[:_LONGEST] for k in names if k in given})

    @property
    def options(self) -> dict[str, Any]:
        """Fields of `DesignOptions`; a field that is not a number is refused."""
        return {
            "limits": (self.limits,) if self.limits else (),
            "duration": _number("duration", self.duration) if self.duration else None,
            "rate": _number("rate", self.rate) if self.rate else None,
            "temperatures": tuple(_number("temperature", one) for one in parts(self.temperature)),
            "narrow": self.narrow,
        }


@router.get("/fits/{fit_id}/design")
def design_page(
    fit_id: str, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Form of the next run, and the expected gain once it was submitted."""
    fit = services.analyses.succeeded(caller, fit_id)
    form, problem, shown = DesignForm.of(request.query_params), "", None
    if request.query_params:
        try:
            shown = services.analyses.design(caller, fit_id, form.options)
        except InputError as error:
            problem = sentence(str(error))
        except (FieldRefused, RunRefused) as error:
            problem = sentence(error.message)
    effects = (fit.result or {}).get("effects") or ()
    return page(
        "design",
        status=422 if problem else 200,
        caller=caller,
        help=help_prefix(services),
        fit=fit_view(FitSummary.of(fit), {}),
        form=form,
        query=urlencode(request.query_params),
        tied=[effect["name"] for effect in effects if effect.get("alternatives")],
        problem=problem,
        figure=_figure(shown.table) if shown else None,
        summary=_summary(shown.entry) if shown else [],
        widths=_widths(shown.entry) if shown else [],
    )


def _figure(table: str) -> str:
    """Plot of the voltage in a profile, the second column of its table."""
    import numpy as np

    from identification.reporting.figures.curves import profile_figure
    from identification.reporting.figures.drawn import drawn_chart
    from identification.result.attempts import figure

    time, voltage = np.loadtxt(io.StringIO(table), delimiter=",", skiprows=1, usecols=(0, 1)).T
    return figure("proposed run", lambda: drawn_chart(profile_figure(time, voltage), _WIDE))


def _summary(entry: Mapping[str, Any]) -> list[str]:
    # Lazy import: numpy would slow down every start.
    from identification.result.numbers import with_symbols

    return [with_symbols(text) for text in entry["summary"]]


def _widths(entry: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Name, unit, value, and width now and after the run of each parameter, as text."""
    from identification.result.numbers import number_text, unit_text

    return [
        (
            name,
            unit_text(one["unit"]),
            number_text(one["value"]),
            *(number_text(one[f"width_{when}"], 3) for when in ("before", "after")),
        )
        for name, one in entry["parameters"].items()
    ]


@router.get("/fits/{fit_id}/design.csv")
def design_file(
    fit_id: str, request: Request, services: ServicesDep, caller: CallerDep
) -> Response:
    """Profile of the next run as a file; the query is that of the page."""
    form = DesignForm.of(request.query_params)
    design = services.analyses.design(caller, fit_id, form.options)
    return Response(
        design.table,
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{fit_id}-next.csv"'},
    )


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise FieldRefused(f"{name} {text[:40]!r} is not a number", field=name) from None

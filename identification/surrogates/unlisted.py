"""Terms outside the catalogue, named `unlisted`: spline curves, ripples and a few laws."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

from identification.model.term import AbstractTerm
from identification.surrogates.angular import AngularFriction
from identification.surrogates.backlash import Backlash
from identification.surrogates.curve import MissingTorque, MissingVoltage
from identification.surrogates.dahl import DahlFriction
from identification.surrogates.ripple import MissingTorqueRipple, MissingVoltageRipple
from identification.surrogates.supply import SupplySag

__all__ = ["LAWS", "unlisted_form", "unlisted_term"]

_FORMS: Final[tuple[Any, ...]] = (
    MissingTorque,
    MissingVoltage,
    MissingTorqueRipple,
    MissingVoltageRipple,
    AngularFriction,
    DahlFriction,
    Backlash,
    SupplySag,
)
LAWS: Final[tuple[type[SupplySag], ...]] = (SupplySag,)
"""Physical laws outside the catalogue that the search tries together with its effects."""


def unlisted_form(equation: object, settings: Mapping[str, Any]) -> Any:
    """Class of the unlisted term that an entry of a result describes, or None.

    Args:
        equation: ``mechanical`` or ``electrical``.
        settings: Fields of the term as in the result.
    """
    fitting = (
        form
        for form in _FORMS
        if form.equation == equation and {f.name for f in dataclasses.fields(form)} == set(settings)
    )
    return next(fitting, None)


def unlisted_term(equation: str, settings: dict[str, Any]) -> AbstractTerm:
    """The unlisted term that an entry of a result describes.

    Args:
        equation: ``mechanical`` or ``electrical``.
        settings: Fields of the term as in the result.
    """
    fields = dict(settings)
    if "starts" in fields:
        fields["starts"] = tuple(fields["starts"])
        fields["imitated"] = tuple((float(a), float(b)) for a, b in fields["imitated"])
        fields["linear"] = tuple(float(width) for width in fields["linear"])
    term: AbstractTerm = unlisted_form(equation, fields)(**fields)
    return term

"""What stands in where no effect of the catalogue explains it: a curve, a ripple, a lag, a turn."""

from __future__ import annotations

from typing import Any, Final

from identification.effects.angular import AngularFriction
from identification.effects.curve import MissingTorque, MissingVoltage
from identification.effects.hysteresis import LaggingFriction
from identification.effects.loose import LoosePart
from identification.effects.ripple import MissingTorqueRipple, MissingVoltageRipple
from identification.model.term import AbstractTerm

__all__ = ["unlisted_term"]

_KINDS: Final[dict[tuple[str, bool], Any]] = {
    ("mechanical", False): MissingTorque,
    ("electrical", False): MissingVoltage,
    ("mechanical", True): MissingTorqueRipple,
    ("electrical", True): MissingVoltageRipple,
}


def unlisted_term(equation: str, settings: dict[str, Any]) -> AbstractTerm:
    """The term that an entry of a result describes.

    Args:
        equation: ``mechanical`` or ``electrical``.
        settings: Fields of the term as they stand in the result.
    """
    fields = dict(settings)
    if "starts" in fields:
        fields["starts"] = tuple(fields["starts"])
        fields["imitated"] = tuple((float(a), float(b)) for a, b in fields["imitated"])
    if "farthest" in fields:
        return LaggingFriction(**fields)
    if "narrowest" in fields:
        return LoosePart(**fields)
    if "turning" in fields:
        return AngularFriction(**fields)
    term: AbstractTerm = _KINDS[equation, "duration" in fields](**fields)
    return term

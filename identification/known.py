"""Known parameter values as a user writes them: ``NAME=VALUE[+-SPREAD[%]]``.

    Kt25=0.048+-5%       0.048 N m/A with a standard deviation of 5 %
    L=2.9e-3+-2e-4       2.9 mH with a standard deviation of 0.2 mH
    Ra25=0.59            0.59 ohm with the default standard deviation of 1 %

One parser serves the command line, HTTP and batch manifests.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from identification.errors import OptionError
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["DEFAULT_SPREAD", "KNOWN", "NUMBER", "Prior", "known_values"]

KNOWN: Final = "--known"
"""Origin of a prior that a user gave by value."""

DEFAULT_SPREAD: Final = 0.01
"""Relative standard deviation if none is given: a resistance changes by 1 % in 2.5 K."""

_NARROWEST: Final = 1e-6
_WIDEST: Final = 5.0
"""Limits of the relative spread: below `_NARROWEST` rounding dominates, above `_WIDEST` the general
prior is narrower."""
_SLOPE_SPREADS: Final = (1e-9, 0.1)
_STEEPEST: Final = 0.1
"""Largest temperature coefficient [1/K]; those of metals and magnets are below 0.01."""
_RANGES: Final = {
    "Ra25": (1e-5, 1e6),
    "Kt25": (1e-7, 1e4),
    "J": (1e-13, 1e6),
    "b": (1e-14, 1e5),
    "L": (1e-8, 1e4),
}
"""Ranges of brushed motors from a watch to a rolling mill, with a decade or more of margin."""
NUMBER: Final = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
"""Pattern of a number with a decimal point."""
_FORM: Final = re.compile(
    rf"\s*(\w+)\s*=\s*({NUMBER})\s*(?:(?:\+-|±)\s*({NUMBER})\s*(%?)\s*)?", re.ASCII
)
_EXPECTED: Final = (
    "expected NAME=VALUE, NAME=VALUE+-SD or NAME=VALUE+-N%, each as a separate argument, with a "
    "decimal point and without a unit"
)


@dataclass(frozen=True)
class Prior:
    """Prior of one parameter of the nominal model: normal, log-normal for a positive parameter."""

    name: str
    value: float
    """Its value; the median of a positive parameter [unit of the parameter]."""
    sd: float
    """Its standard deviation; divided by `value`, that of the logarithm of a positive parameter
    [unit of the parameter]."""
    origin: str = KNOWN
    """Option that gave it: ``--known`` or ``--nameplate``."""

    @property
    def is_size(self) -> bool:
        """True if the parameter is positive by nature and its prior log-normal."""
        return not self.name.startswith("alpha_")

    @property
    def unit(self) -> str:
        """Unit of value and standard deviation."""
        return DECLARED_PARAMETERS[self.name].unit

    def __str__(self) -> str:
        """The prior in the syntax of the parser, with all digits."""
        return f"{self.name}={self.value!r}+-{self.sd!r}"


def known_values(words: Sequence[str]) -> tuple[Prior, ...]:
    """Priors from the arguments of a user, in the order given.

    Args:
        words: Arguments such as ``Kt25=0.048+-5%``; values and absolute spreads in SI units.

    Raises:
        OptionError: An argument has another form, a name is unknown or given twice, or a number is
            out of range.
    """
    found: dict[str, Prior] = {}
    for word in words:
        prior = _prior(word)
        if prior.name in found:
            raise _refusal(word, f"{prior.name} is given twice; keep one")
        found[prior.name] = prior
    return tuple(found.values())


def _prior(word: str) -> Prior:
    name = word.partition("=")[0].strip()
    if name not in DECLARED_PARAMETERS:
        names = ", ".join(DECLARED_PARAMETERS)
        raise _refusal(word, f"there is no parameter {name[:60]!r}; expected one of {names}")
    match = _FORM.fullmatch(word)
    if match is None:
        unit = DECLARED_PARAMETERS[name].unit
        raise _refusal(word, f"{_EXPECTED}; {name} is in {unit}")
    value = float(match[2])
    sd = DEFAULT_SPREAD * abs(value) if match[3] is None else float(match[3])
    prior = Prior(name, value, sd / 100.0 * abs(value) if match[4] else sd)
    _check_value(word, prior)
    _check_spread(word, prior, is_given=match[3] is not None)
    return prior


def _check_value(word: str, prior: Prior) -> None:
    unit = prior.unit
    least, most = _RANGES.get(prior.name, (-_STEEPEST, _STEEPEST))
    if not least <= prior.value <= most:
        wanted = (
            f"a positive number in {unit}, from {least:g} to {most:g}"
            if prior.is_size
            else f"a number from {least:g} to {most:g} {unit}, for example 0.0039 for copper"
        )
        raise _refusal(word, f"{prior.name} is {prior.value:g} {unit}; expected {wanted}")


def _check_spread(word: str, prior: Prior, *, is_given: bool) -> None:
    if prior.sd == 0.0 and not is_given:
        raise _refusal(
            word, "the default standard deviation is 1 % of 0; give one, such as alpha_Kt=0+-0.0005"
        )
    if not 0.0 < prior.sd < math.inf:
        raise _refusal(
            word,
            f"the standard deviation is {prior.sd:g} {prior.unit}; expected a positive number, or "
            "omit it for 1 %",
        )
    share = prior.sd / prior.value if prior.is_size else prior.sd
    least, most = (_NARROWEST, _WIDEST) if prior.is_size else _SLOPE_SPREADS
    if not least <= share <= most:
        limits = (
            f"{100 * least:g} to {100 * most:g} % of the value (for per cent, end with %)"
            if prior.is_size
            else f"{least:g} to {most:g} {prior.unit}"
        )
        raise _refusal(
            word, f"the standard deviation is {prior.sd:g} {prior.unit}; expected {limits}"
        )


def _refusal(word: str, message: str) -> OptionError:
    return OptionError(f"known {word[:80]!r}: {message}", value=word)

"""Catalogue of the effects: the registered classes of this package by name, the most common first.

Each module of the package is imported, so a new effect needs a class with the decorator `register`
in one file.  A class in another package is added at the end of the catalogue when it is imported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import Final

from identification import effects
from identification.effects.confusion import CONFUSIONS, Confusion
from identification.effects.effect import REGISTERED, AbstractEffect

__all__ = ["CATALOGUE", "confusions", "confusions_of"]

_COMMON_FIRST: Final = (
    "coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_temperature", "load_torque",
    "load_step", "cogging_torque", "inertia_change", "shaft_compliance", "brush_drop",
    "flux_saturation", "inductance_saturation", "self_heating", "winding_lag", "magnet_lag",
    "resistance_curvature", "demagnetization", "current_offset", "voltage_offset", "speed_offset",
    "channel_delay", "speed_filter", "current_filter", "input_hold",
)  # fmt: skip
"""Effects in the order in which they decide ties; all others are less common."""


for _module in iter_modules(effects.__path__):
    import_module(f"{effects.__name__}.{_module.name}")

for _name in (*_COMMON_FIRST, *(name for name in REGISTERED if name not in _COMMON_FIRST)):
    REGISTERED[_name] = REGISTERED.pop(_name)

CATALOGUE: Final[Mapping[str, type[AbstractEffect]]] = REGISTERED


def confusions() -> tuple[Confusion, ...]:
    """All confusions: the known ones, then those that only further effects declare."""
    declared = (confusion for kind in CATALOGUE.values() for confusion in kind.confusions)
    return tuple(dict.fromkeys((*CONFUSIONS, *declared)))


def confusions_of(names: Sequence[str]) -> list[Confusion]:
    """Confusions of one of these effects; names outside the catalogue have none."""
    declared = {c for name in names if name in CATALOGUE for c in CATALOGUE[name].confusions}
    return [confusion for confusion in confusions() if confusion in declared]

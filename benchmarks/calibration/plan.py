"""Campaigns of the calibration benchmark: a stratified sequence determined by the number.

Campaign n has the kind n modulo 3 and the noise n modulo 5, so 15 consecutive campaigns hold each
combination once.  Record length, origin of the intervals and angle alternate between such blocks.

| kind | hidden effect |
|---|---|
| `clean` | none |
| `effect` | one of the catalogue, with any law and a size from its usual range |
| `omitted` | one that the search may not use: withheld, or not in the catalogue |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from bench import EFFECTS, EffectRequest, Noise
from bench.options import BenchOptions
from identification.effects.catalogue import CATALOGUE

__all__ = ["KINDS", "NOISES", "Item", "item_of"]

KINDS: Final = ("clean", "effect", "omitted")
NOISES: Final[dict[str, Noise]] = {
    "white": Noise(),
    "coloured": Noise(kind="coloured"),
    "quantised": Noise(step=3.0),
    "spiky": Noise(kind="spiky"),
    "heavy": Noise(kind="heavy"),
}
"""Noise by name; quantised channels have a resolution of two to three standard deviations."""

_BLOCK: Final = len(KINDS) * len(NOISES)
_ROWS: Final = (600, 2500)
_LONG_ROWS: Final = 6000
_LONG_EVERY: Final = 8
_MOTORS: Final = 50_000
"""Seed of the first motor; the other benchmarks use seeds below or far above."""


@dataclass(frozen=True)
class Item:
    """One campaign.

    Args:
        number: Number of the campaign; the seed of motor, excitation and noise follows from it.
        kind: Key of `KINDS`.
        noise: Key of `NOISES`.
        rows: Samples per run.
        has_angle: Whether the angle is logged.
        effect: Hidden effect; None for a clean motor.
        withheld: Effect types that the search may not use.
        is_sampled: Whether the posterior is sampled; otherwise the intervals come from the
            covariance of the fit.
    """

    number: int
    kind: str
    noise: str
    rows: int
    has_angle: bool
    effect: EffectRequest | None
    withheld: tuple[str, ...]
    is_sampled: bool

    @property
    def motor(self) -> int:
        """Seed of the random motor."""
        return _MOTORS + self.number

    @property
    def options(self) -> BenchOptions:
        """Options of the bench."""
        noise = NOISES[self.noise]
        return BenchOptions(
            rows=self.rows, noise=noise, position="absolute" if self.has_angle else "none"
        )


def item_of(number: int) -> Item:
    """Campaign of a number, from 0."""
    rng = np.random.default_rng([number, 1906])
    block = number // _BLOCK
    is_long = block % _LONG_EVERY == _LONG_EVERY - 1
    low, high = np.log(_ROWS)
    rows = _LONG_ROWS if is_long else round(float(np.exp(rng.uniform(low, high))))
    kind = KINDS[number % len(KINDS)]
    effect: EffectRequest | None = None
    withheld: tuple[str, ...] = ()
    if kind != "clean":
        # A fixed permutation, so that consecutive campaigns run through all effects.
        is_listed = kind == "effect" or block % 2 == 0
        names = [name for name in EFFECTS if (name in CATALOGUE) == is_listed]
        names = [names[k] for k in np.random.default_rng(7).permutation(len(names))]
        name = names[(number // len(KINDS)) % len(names)]
        lowest, largest = EFFECTS[name].typical
        size = lowest * (largest / lowest) ** rng.uniform()
        effect = EffectRequest(name, float(size), str(rng.choice(list(EFFECTS[name].laws))))
        withheld = (name,) if kind == "omitted" and is_listed else ()
    return Item(
        number=number,
        kind=kind,
        noise=list(NOISES)[number % len(NOISES)],
        rows=rows,
        has_angle=bool(rng.uniform() < 0.5),
        effect=effect,
        withheld=withheld,
        is_sampled=not is_long and block % 2 == 0,
    )

"""Measurements of the comparison: programs, sizes and commands.

Each measurement has a key, which the log contains once, and the words of a command.  `{task}` and
`{campaign}` stand for files that are made on demand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

__all__ = ["EFFECTS", "PARTS", "SAMPLERS", "Measurement", "plan"]

PARTS: Final = ("kernels", "effects", "fit", "posterior", "terms", "loop")

SAMPLERS: Final[dict[str, tuple[str, ...]]] = {
    "motorid": ("ours", "posterior"),
    "emcee, loop": ("emcee_numba", "--kernel", "loop", "--moves", "stretch"),
    "emcee DE, loop": ("emcee_numba", "--kernel", "loop", "--moves", "de"),
    "emcee, lanes": ("emcee_numba", "--kernel", "lanes", "--moves", "stretch"),
    "emcee DE, lanes": ("emcee_numba", "--kernel", "lanes", "--moves", "de"),
    "NUTS": ("nuts",),
}

FITTERS: Final[dict[str, tuple[str, ...]]] = {
    "motorid": ("ours", "fit"),
    "scipy": ("fit", "--program", "scipy"),
    "pyPESTO ls_trf": ("fit", "--program", "pypesto", "--optimizer", "ls_trf"),
    "pyPESTO L-BFGS-B": ("fit", "--program", "pypesto", "--optimizer", "L-BFGS-B"),
}

EFFECTS: Final = (
    "", "coulomb_friction=0.02", "coulomb_friction=0.06", "brush_drop=0.02", "brush_drop=0.05",
    "quadratic_drag=0.04", "quadratic_drag=0.1", "load_torque=0.02", "load_torque=0.06",
    "flux_saturation=0.02", "flux_saturation=0.04",
)  # fmt: skip
"""Hidden effect and size of each campaign for the terms; empty for a clean motor."""

_MOST_ROWS: Final = {"emcee DE, lanes": 1_000_000}
"""Largest size of a peer's sampler, if it exceeds a hundred thousand rows."""

_OURS: Final = 3
"""Measurements of the posterior by motorid, between those of the peers."""


@dataclass(frozen=True)
class Measurement:
    """One process to run.

    Args:
        part: Part of the comparison.
        name: Program.
        rows: Samples of all runs together.
        repeat: Number of the repetition, also the seed.
        words: Module of `benchmarks.peers` and its arguments.
        is_peer: Whether it runs in the environment of the peers.
        effect: Hidden effect of the campaign.
    """

    part: str
    name: str
    rows: int
    repeat: int
    words: tuple[str, ...]
    is_peer: bool = False
    effect: str = ""

    @property
    def key(self) -> str:
        """Unique key in the log."""
        return "/".join((self.part, self.name, str(self.rows), self.effect, str(self.repeat)))


def plan(parts: Sequence[str], sizes: Sequence[int], repeats: int) -> Iterator[Measurement]:
    """Measurements in the order of their execution.

    Args:
        parts: Names of `PARTS`.
        sizes: Samples of all runs together, each where the part scales with them.
        repeats: Repetitions of each sampler and each fit.
    """
    makers = {
        "kernels": lambda: _single("kernels", [max(n for n in sizes if n <= 100_000)]),
        "effects": lambda: _single("effects", [min(sizes)]),
        "fit": lambda: _programs("fit", FITTERS, sizes, repeats),
        "posterior": lambda: _posteriors(sizes, repeats),
        "terms": lambda: _terms(),
        "loop": lambda: _loops(sizes),
    }
    for part in parts:
        yield from makers[part]()


def _single(what: str, sizes: Sequence[int]) -> Iterator[Measurement]:
    for rows in sizes:
        yield Measurement(what, "motorid", rows, 0, ("costs", what, "--rows", str(rows)))


def _programs(
    part: str, programs: dict[str, tuple[str, ...]], sizes: Sequence[int], repeats: int
) -> Iterator[Measurement]:
    for rows in sizes:
        for repeat in range(repeats):
            for name, words in programs.items():
                if name.endswith("L-BFGS-B") and rows > 10_000:
                    continue  # a hundred times slower
                yield Measurement(
                    part, name, rows, repeat, (*words, "{task}"), is_peer=name != "motorid"
                )


def _posteriors(sizes: Sequence[int], repeats: int) -> Iterator[Measurement]:
    for rows in sizes:
        # The others need hours for a million samples.
        peers = [
            (name, words)
            for name, words in SAMPLERS.items()
            if name != "motorid" and rows <= _MOST_ROWS.get(name, 100_000)
        ]
        for repeat in range(repeats):
            for turn in range(_OURS):
                seed = _OURS * repeat + turn
                words = (*SAMPLERS["motorid"], "{task}", "--seed", str(seed))
                yield Measurement("posterior", "motorid", rows, seed, words)
                for name, command in peers[turn::_OURS]:
                    own = (*command, "{task}", "--seed", str(repeat))
                    yield Measurement("posterior", name, rows, repeat, own, is_peer=True)


def _terms() -> Iterator[Measurement]:
    rows = 10_000
    for effect in EFFECTS:
        words = ("loop", "{campaign}", "--no-posterior")
        yield Measurement("terms", "motorid", rows, 0, words, effect=effect)
        yield Measurement(
            "terms", "PySINDy", rows, 0, ("sindy", "{campaign}"), is_peer=True, effect=effect
        )


def _loops(sizes: Sequence[int]) -> Iterator[Measurement]:
    for rows in sizes:
        yield Measurement(
            "loop", "motorid", rows, 0, ("loop", "{campaign}"), effect="brush_drop=0.03"
        )

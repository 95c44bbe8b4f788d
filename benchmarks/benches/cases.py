"""Cases of the benchmark, with the required and the permitted effects of each.

Each case has a clean motor and one with dry friction and a voltage drop at the brushes; the cases
"everything" hide three to five effects of realistic size.

| case | required effects | further permitted effects |
|---|---|---|
| any clean motor | nothing | nothing |
| any with friction | `coulomb_friction` and `brush_drop` | nothing |
| everything | the kind of each hidden effect | nothing |

and additionally

| case | required effects | further permitted effects |
|---|---|---|
| encoder | | `channel_delay` or `speed_filter`: a mean over the interval lags by half of it |
| commanded | | `brush_drop`: a dead time takes a voltage with the sign of the current; |
| | | `voltage_offset`, `unlisted`: dead zone and supply resistance, not in the catalogue |
| current_filter | `current_filter` | |
| current_zero | `current_offset` | |
| thermocouple | | `winding_lag` or `magnet_lag`: the thermometer lags |

With one direction of motion, friction is confounded with a load torque, and a brush drop with a
zero error of the voltage; either name is correct, also as an alternative.

`Ra25` is not counted with a commanded voltage, because the supply resistance is in series with it.
The voltage of a missing row is lost; if it changed there, no model reaches the noise level.
Without a thermometer, the temperature of the first run is 25 degC by definition; the true `Ra25`
and `Kt25` refer to that temperature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["CASES", "CELLS", "COVERED", "Case", "Cell", "is_right", "wrong_kinds"]

COVERED: Final = ("Ra25", "Kt25", "J", "b")
"""Parameters whose intervals are counted."""


@dataclass(frozen=True)
class Case:
    """Recording properties of a bench.

    Args:
        name: Name of the case.
        says: Description of the case.
        intervals: Sample intervals of the runs, the validation run last [s].
        temperatures: Temperatures of the runs [degC].
        drift: Change of the temperature during a run [K].
        needed: Further required effect types, which the bench adds.
        allowed: Further permitted effect types.
        uncounted: Parameters whose intervals are not counted.
        has_alternatives: Whether alternatives count as named.
    """

    name: str
    says: str
    intervals: tuple[float, ...] = (1e-3, 1e-3, 1e-3, 1e-3)
    temperatures: tuple[float, ...] = (30.0, 65.0, 100.0, 50.0)
    drift: float = 6.0
    needed: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()
    uncounted: tuple[str, ...] = ()
    has_alternatives: bool = False


CASES: Final[dict[str, Case]] = {
    case.name: case
    for case in (
        Case("speed_loop", "the voltage is the output of a PI speed controller"),
        Case(
            "encoder",
            "speed from differences of encoder counts",
            allowed=("channel_delay", "speed_filter"),
        ),
        Case(
            "commanded",
            "commanded voltage: dead time, dead zone, supply with a source resistance",
            allowed=("brush_drop", "voltage_offset", "unlisted"),
            uncounted=("Ra25",),
        ),
        Case("current_filter", "current filter of 0.5 to 5 ms", needed=("current_filter",)),
        Case("current_zero", "current zero drifts from run to run", needed=("current_offset",)),
        Case(
            "thermocouple",
            "thermocouple with a lag of 3 to 15 s and 1 K steps",
            drift=15.0,
            allowed=("winding_lag", "magnet_lag"),
        ),
        Case("missing_rows", "0.5 % of the rows and one block of 2 % are missing"),
        Case(
            "jitter",
            "instants scatter by 10 % of an interval; 1, 0.5 and 2 ms by runs",
            intervals=(1e-3, 5e-4, 2e-3, 1e-3),
        ),
        Case("one_way", "one direction only", has_alternatives=True),
        Case(
            "narrow",
            "20 to 40 degC only",
            temperatures=(22.0, 30.0, 38.0, 27.0),
            drift=2.0,
        ),
        Case("no_thermometer", "no thermometer", drift=0.5),
        Case("slow", "200 Hz logging", intervals=(5e-3, 5e-3, 5e-3, 5e-3)),
        Case("everything", "three to five effects"),
        Case("everything_angle", "cogging and two to four more, angle logged"),
    )
}


@dataclass(frozen=True)
class Cell:
    """Combination of a case and a type of motor.

    Args:
        case: Recording properties of the bench.
        motor: ``clean``, ``friction`` (and brush drop) or ``mixed``.
    """

    case: Case
    motor: str

    @property
    def name(self) -> str:
        """Case and motor."""
        return f"{self.case.name}:{self.motor}"


CELLS: Final[tuple[Cell, ...]] = tuple(
    Cell(case, motor)
    for motors in (("friction", "mixed"), ("clean",))
    for case in CASES.values()
    for motor in motors
    if (motor == "mixed") == case.name.startswith("everything")
)
"""All cells; campaign n belongs to cell n modulo their number."""

_EQUAL_ONE_WAY: Final = (
    frozenset({"coulomb_friction", "load_torque"}),
    frozenset({"brush_drop", "voltage_offset"}),
)


def is_right(
    case: Case,
    hidden: tuple[str, ...],
    named: tuple[str, ...],
    others: tuple[str, ...] = (),
    withheld: tuple[str, ...] = (),
) -> bool:
    """Return True if every hidden effect is named, except undetectable ones.

    Args:
        case: Recording properties of the bench.
        hidden: Hidden effect types.
        named: Named effect types.
        others: Alternatives, if they count.
        withheld: Effect types excluded from the search.
    """
    found = {*named, *others} if case.has_alternatives else set(named)
    needed = [kind for kind in (*hidden, *case.needed) if kind not in withheld]
    return all(found & _equal(case, kind) for kind in needed)


def wrong_kinds(case: Case, hidden: tuple[str, ...], named: tuple[str, ...]) -> list[str]:
    """Named effect types that are not permitted.

    Args:
        case: Recording properties of the bench.
        hidden: Hidden effect types.
        named: Named effect types.
    """
    fine = {*case.needed, *case.allowed}
    fine = fine.union(*(_equal(case, kind) for kind in hidden))
    return [kind for kind in named if kind not in fine]


def _equal(case: Case, kind: str) -> frozenset[str]:
    """Effect types confounded with this one on such a bench, including itself."""
    same = [group for group in _EQUAL_ONE_WAY if kind in group] if case.name == "one_way" else []
    return same[0] if same else frozenset({kind})

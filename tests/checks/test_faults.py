"""Faults as benches make them: each is refused with its correction, suspected, or said."""

from __future__ import annotations

import pytest

from benchmarks.fault_table import FAULTS, Fault
from benchmarks.faults import seen

MET = {
    "refuse": {"refuse"},
    "suspect": {"refuse", "suspect"},
    "said": {"refuse", "suspect", "said"},
}
SMALL_MOTOR = 7001
"""33 W, 27 V: no unit of it that is wrong is out of the reader's bounds but mV."""


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: f"{fault.name}, {fault.scope}")
def test_a_fault_is_found_and_its_correction_corrects_it(fault: Fault) -> None:
    """The table says what is expected; a correction counts once the runs are read with it."""
    found = seen(fault, SMALL_MOTOR, rows=1500)

    assert found.after in MET[fault.outcome], found
    if fault.corrected:
        assert found.corrected is not False, found
        assert "--map '" in found.words


def test_the_table_holds_more_than_25_kinds() -> None:
    """A fault in one run and in all runs is one kind."""
    assert len({fault.name for fault in FAULTS}) >= 25

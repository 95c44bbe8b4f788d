"""The document of the torture tests is written section by section."""

from __future__ import annotations

from benchmarks.torture.document import section, with_section
from benchmarks.torture.outcome import Outcome

TITLE = "# Stress tests of the service"

ORDER = ("kills", "files", "load")


def of(name: str, measured: str) -> str:
    """Section with one outcome."""
    return section(name, [Outcome("a test", "all", measured, True)], short=False, seconds=30.0)


def test_section_names_the_command_that_writes_it() -> None:
    """A reader can repeat the measurement."""
    words = section("files", [Outcome("a|b", "x", "1\n2", False)], short=True, seconds=600.0)

    assert "Made by `python -m benchmarks.torture --only files --short` in 10 minutes." in words
    assert r"| a\|b | x | 1 2 | **fail** |" in words


def test_section_is_replaced_and_the_others_are_kept() -> None:
    """Sections follow the order of the modules; other text in the document is kept."""
    text = ""
    for name, measured in (("load", "1"), ("audit", "2"), ("kills", "3"), ("load", "4")):
        text = with_section(text, name, of(name, measured), ORDER)
    text = text.replace(TITLE, f"{TITLE}\n\nOn a bench.")
    text = with_section(text, "files", of("files", "5"), ORDER)

    found = [line for line in text.splitlines() if line.startswith(("#", "| a test", "On"))]
    cells = [f"| a test | all | {measured} | pass |" for measured in "3542"]
    heads = ["## kills", "## files", "## load", "## audit"]
    pairs = [word for pair in zip(heads, cells, strict=True) for word in pair]
    assert found == [TITLE, "On a bench.", *pairs]

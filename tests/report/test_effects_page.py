"""docs/effects.md matches the catalogue from which it is generated."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from identification.effects.catalogue import CATALOGUE, confusions, confusions_of
from identification.effects.effect import CampaignScales
from identification.quantities import DECLARED_PARAMETERS
from identification.report.effects_page import effects_page, example_scales

PAGE = (Path(__file__).parents[2] / "docs/effects.md").read_text("utf-8")


@pytest.fixture(scope="module")
def scales() -> CampaignScales:
    """Natural scales of the example on the page."""
    return example_scales()


def test_page_matches_the_catalogue(scales: CampaignScales) -> None:
    """`python -m identification.report.effects_page` regenerates the page."""
    assert effects_page(scales) == PAGE


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_effect_has_its_section_with_formula_parameters_and_source(
    name: str, scales: CampaignScales
) -> None:
    """The section of each effect contains the docstring of its class."""
    kind = CATALOGUE[name]
    section = PAGE.split(f"\n## {name}\n")[1].split("\n## ")[0]
    (candidate, *_) = kind.candidates(scales)

    assert kind.source in section
    assert f"Equation: {kind.equation}." in section
    assert "=" in section or "->" in section or not candidate.term.parameters
    for parameter in candidate.term.parameters:
        assert re.search(
            rf"^\| `{parameter.name}` \| {re.escape(parameter.unit)} \|", section, re.M
        )


def test_confusions_name_parameters_that_exist() -> None:
    """A renamed parameter must not leave a warning that is never shown."""
    parameters = {name for confusion in confusions() for name in confusion.parameters}

    assert parameters <= set(DECLARED_PARAMETERS)


def test_a_found_effect_brings_its_confusions_and_no_others() -> None:
    """A brush drop is confounded with resistance, not with the zero error of the speed."""
    titles = [confusion.title for confusion in confusions_of(["brush_drop"])]

    assert titles == ["brush drop and armature resistance"]
    assert confusions_of([]) == []

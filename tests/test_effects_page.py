"""docs/effects.md matches the catalogue from which it is generated."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks.effects_page import effects_page, example_scales
from benchmarks.effects_plots import effect_plot, signature
from identification.effects.catalogue import CATALOGUE, confusions, confusions_of
from identification.effects.effect import CampaignScales
from identification.quantities import DECLARED_PARAMETERS

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "effects.md").read_text("utf-8")


@pytest.fixture(scope="module")
def scales() -> CampaignScales:
    """Natural scales of the example on the page."""
    return example_scales()


def test_page_matches_the_catalogue(scales: CampaignScales) -> None:
    """`python -m benchmarks.effects_page` regenerates the page."""
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


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_effect_has_its_plot(name: str) -> None:
    """A small picture, drawn by `python -m benchmarks.effects_plots`."""
    plot = DOCS / "pictures" / "effects" / f"{name}.svg"

    assert f"](pictures/effects/{name}.svg)" in PAGE
    root = ElementTree.fromstring(plot.read_text("utf-8"))
    assert root.findtext("{http://www.w3.org/2000/svg}title") == f"Signature of {name}"
    assert 1_000 < plot.stat().st_size < 20_000


def test_signature_over_the_driver_is_the_law(scales: CampaignScales) -> None:
    """Coulomb friction is -T_c sgn w, and drag grows with the square of the speed."""
    friction = signature(CATALOGUE["coulomb_friction"], scales)
    torque = friction.curves["missing torque [N m]"]
    far = np.abs(friction.x) > 50.0
    size = 0.05 * scales.torque

    np.testing.assert_allclose(torque[far], -size * np.sign(friction.x[far]), rtol=0.02)

    drag = signature(CATALOGUE["quadratic_drag"], scales)
    torque = drag.curves["missing torque [N m]"]
    slope = np.polyfit(np.log(drag.x[drag.x > 100.0]), np.log(-torque[drag.x > 100.0]), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1)


def test_signature_of_an_offset_is_constant(scales: CampaignScales) -> None:
    """A zero error of the current sensor changes the logged current alone."""
    shown = signature(CATALOGUE["current_offset"], scales)
    current, speed = shown.curves.values()

    assert np.ptp(current) < 1e-9 < abs(current[0])
    assert np.abs(speed).max() < 1e-9


def test_plot_is_a_picture_of_its_own(scales: CampaignScales) -> None:
    """The file has its colours within; it repeats the committed one except for rounding."""
    text = effect_plot("brush_drop", signature(CATALOGUE["brush_drop"], scales))
    stored = (DOCS / "pictures" / "effects" / "brush_drop.svg").read_text("utf-8")

    def numbers(drawing: str) -> list[float]:
        (curve,) = re.findall(r'class="line" d="M([^"]+)"', drawing)
        return [float(word) for word in curve.split()]

    assert text.startswith("<svg")
    assert "<style>" in text
    np.testing.assert_allclose(numbers(text), numbers(stored), atol=0.5)

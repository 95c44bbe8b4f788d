"""Parsing of known values and nameplates."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.errors import OptionError
from identification.known import Prior, known_values
from identification.nameplate import nameplate_of
from identification.options import FitOptions
from identification.quantities import DECLARED_PARAMETERS

SIZES = ("Ra25", "Kt25", "J", "b", "L")


@pytest.mark.parametrize(
    ("word", "name", "value", "sd"),
    [
        ("Kt25=0.048+-5%", "Kt25", 0.048, 0.0024),
        ("Kt25 = 0.048 ± 5 %", "Kt25", 0.048, 0.0024),
        ("L=2.9e-3+-2e-4", "L", 0.0029, 2e-4),
        ("L=2.9e-3", "L", 0.0029, 2.9e-5),
        ("alpha_Kt=-0.0012+-10%", "alpha_Kt", -0.0012, 1.2e-4),
        ("alpha_Kt=0+-0.0005", "alpha_Kt", 0.0, 5e-4),
        ("J=1e-4+-1e-5", "J", 1e-4, 1e-5),
    ],
)
def test_known_value_is_read_as_it_is_written(
    word: str, name: str, value: float, sd: float
) -> None:
    """The spread is given in the unit, in per cent, or defaults to 1 %."""
    (prior,) = known_values([word])

    assert (prior.name, prior.value) == (name, value)
    assert prior.sd == pytest.approx(sd)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["Kt=0.048"], "no parameter 'Kt'; expected one of Ra25, alpha_Ra, Kt25"),
        (["0.048"], "no parameter '0.048'"),
        (["Kt25"], "expected NAME=VALUE"),
        (["Kt25=fast"], "expected NAME=VALUE"),
        (["Kt25=1_0"], "expected NAME=VALUE"),
        (["Kt25=0.048+-"], "expected NAME=VALUE"),
        (["Kt25=0.048+-5%%"], "expected NAME=VALUE"),
        (["Kt25=nan"], "expected NAME=VALUE"),
        (["Kt25=0,048"], "with a decimal point and without a unit; Kt25 is in N m/A"),
        (["L=2.9mH"], "without a unit; L is in H"),
        (["Kt25=0.048,L=2.9e-3"], "each as a separate argument"),
        (["Kt25=0.048+-5"], "for per cent, end with %"),
        (["Kt25=0.048\n"], None),
        (["Kt25=-0.048"], "Kt25 is -0.048 N m/A; expected a positive number"),
        (["J=0"], "J is 0 kg m\\^2; expected a positive number"),
        (["J=1e999"], "J is inf kg m\\^2; expected"),
        (["L=1e-15"], "L is 1e-15 H; expected a positive number in H, from 1e-08 to 10000"),
        (["alpha_Ra=3.9"], "expected a number from -0.1 to 0.1 1/K"),
        (
            ["Kt25=0.048+--5%"],
            "the standard deviation is -0.0024 N m/A; expected a positive number",
        ),
        (["Kt25=0.048+-0"], "the standard deviation is 0 N m/A; expected a positive number"),
        (["Kt25=0.048+-1e9%"], "expected 0.0001 to 500 % of the value"),
        (["alpha_Kt=0"], "the default standard deviation is 1 % of 0; give one"),
        (["Kt25=0.048", "L=1e-3", "Kt25=0.05"], "Kt25 is given twice; keep one"),
    ],
)
def test_invalid_known_value_is_refused_with_the_expected_form(
    words: list[str], said: str | None
) -> None:
    """The message contains the text, its fault and the expected form; outer blanks are ignored."""
    if said is None:
        assert known_values(words)
        return
    with pytest.raises(OptionError, match=said) as caught:
        FitOptions(known=tuple(words))
    assert caught.value.value in words


@given(
    name=st.sampled_from(SIZES),
    value=st.floats(1e-5, 1e3),
    share=st.floats(1e-5, 4.0),
)
def test_prior_of_a_positive_parameter_reads_back_from_its_text(
    name: str, value: float, share: float
) -> None:
    """`str` of a prior is valid input, with all digits."""
    prior = Prior(name, value, share * value)

    assert known_values([str(prior)]) == (prior,)


@given(
    name=st.sampled_from([n for n in DECLARED_PARAMETERS if n not in SIZES]),
    value=st.floats(-0.1, 0.1),
    sd=st.floats(1e-8, 0.1),
)
def test_prior_of_a_coefficient_reads_back_from_its_text(
    name: str, value: float, sd: float
) -> None:
    """Temperature coefficients have either sign and may be zero."""
    prior = Prior(name, value, sd)

    assert known_values([str(prior)]) == (prior,)


@given(st.text(max_size=40))
def test_any_text_is_a_known_value_or_an_option_error(text: str) -> None:
    """No other exception reaches the user."""
    for word in (text, f"Kt25={text}", f"L=1{text}"):
        try:
            (prior,) = known_values([word])
        except OptionError:
            continue
        assert math.isfinite(prior.value)
        assert prior.sd > 0.0


@given(st.text(max_size=40))
def test_any_text_is_a_nameplate_or_an_option_error(text: str) -> None:
    """No other exception reaches the user."""
    for word in (text, f"voltage={text}", f"voltage=12,no_load_speed=3000{text}"):
        try:
            plate = nameplate_of(word)
        except OptionError:
            continue
        assert all(math.isfinite(prior.value) for prior in plate.priors)


def test_nameplate_gives_the_parameters_of_the_steady_state() -> None:
    """Ra = 12 / 4 ohm; Kt = (12 - 3 * 0.2) / 300 V s/rad; b <= Kt * 0.2 / 300."""
    plate = nameplate_of("voltage=12, no_load_speed=300; no_load_current=200mA, stall_current=4 A,")

    assert plate.resistance == pytest.approx(3.0)
    assert plate.constant == pytest.approx(0.038)
    assert plate.friction == pytest.approx(0.038 * 0.2 / 300)
    assert [p.name for p in plate.priors] == ["Ra25", "Kt25"]
    assert [p.sd / p.value for p in plate.priors] == pytest.approx([0.2, 0.1])


def test_rated_point_replaces_a_stall_current() -> None:
    """Motor of 3 ohm and 0.038 V s/rad: 0.2 A at 300 rad/s and 1.2 A at 221.05 rad/s."""
    loaded = (12 - 3 * 1.2) / 0.038
    plate = nameplate_of(
        f"voltage=12,no_load_speed=300,no_load_current=0.2,rated_current=1.2,rated_speed={loaded}"
    )

    assert plate.resistance == pytest.approx(3.0)
    assert plate.constant == pytest.approx(0.038)


def test_torques_determine_the_constant_without_a_speed() -> None:
    """Kt = T / (I - I0) at standstill and at the rated point."""
    stalled = nameplate_of("stall_current=4,stall_torque=150mNm")
    rated = nameplate_of("rated_current=1.2,no_load_current=0.2,rated_torque=0.038")

    assert stalled.constant == pytest.approx(0.0375)
    assert rated.constant == pytest.approx(0.038)
    assert stalled.resistance is None


def test_revolutions_per_minute_are_converted_to_radians() -> None:
    """3000 rpm are 314.16 rad/s."""
    assert nameplate_of("voltage=12,no_load_speed=3000rpm") == nameplate_of(
        f"voltage=12,no_load_speed={100 * math.pi!r}"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("volts=12", "expected KEY=VALUE with a key of voltage, no_load_speed"),
        ("voltage", "expected KEY=VALUE"),
        ("voltage=12,voltage=24", "voltage is given twice; keep one"),
        ("voltage=12A", "expected a number in V, or one with the unit V, mV"),
        ("voltage=-12", "is -12 V; expected 1e-09 to 1e\\+09 V"),
        ("voltage=12", "determines neither Ra25 nor Kt25; expected for example voltage="),
        ("voltage=12,no_load_current=5,stall_current=4", "no_load_current below stall_current"),
        (
            "voltage=12,no_load_speed=3000,no_load_current=0.2,stall_current=4,stall_torque=0.15",
            "10.4 times .*append rpm",
        ),
        (
            "voltage=12,no_load_speed=3000rpm,no_load_current=0.2,stall_current=4,"
            "rated_current=1.2,rated_torque=38",
            "from the rated torque is 1.05e\\+03 times .* mNm to a torque",
        ),
        (
            "voltage=12,5,no_load_speed=3000rpm",
            "'5': expected KEY=VALUE .* and a decimal point",
        ),
    ],
)
def test_invalid_nameplate_is_refused_with_the_expected_form(text: str, said: str) -> None:
    """The message contains the entry, its fault and the expected form."""
    with pytest.raises(OptionError, match=said):
        FitOptions(nameplate=text)


def test_rated_torque_is_no_contradiction_where_the_current_without_load_is_unknown() -> None:
    """Half of the 1.2 A may be no-load current, so Kt may be twice 12 mN m / 1.2 A."""
    plate = nameplate_of("voltage=12,no_load_speed=600,rated_current=1.2,rated_torque=11mNm")

    assert plate.constant == pytest.approx(0.02)


def test_known_value_has_priority_over_the_nameplate() -> None:
    """Each parameter has one prior: the one given by name."""
    options = FitOptions(
        known=("Kt25=0.04+-2%",), nameplate="voltage=12,no_load_speed=3000rpm,stall_current=4"
    )

    assert [(p.name, p.origin) for p in options.priors] == [
        ("Kt25", "--known"),
        ("Ra25", "--nameplate"),
    ]

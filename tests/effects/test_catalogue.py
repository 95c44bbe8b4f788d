"""Catalogue: properties that each effect must have."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.ingest.run import Run
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record, records_of
from identification.model.simulate import Simulator, initial_states
from identification.result.schema import result_schema
from identification.surrogates.unlisted import LAWS, SURROGATES

CONTRACT = {
    "coulomb_friction": ("mechanical", ("speed",)),
    "stribeck_friction": ("mechanical", ("speed",)),
    "quadratic_drag": ("mechanical", ("speed",)),
    "viscous_temperature": ("mechanical", ("speed", "temperature")),
    "load_torque": ("mechanical", ()),
    "load_step": ("mechanical", ("time",)),
    "cogging_torque": ("mechanical", ("position",)),
    "inertia_change": ("mechanical", ("time",)),
    "shaft_compliance": ("mechanical", ("speed",)),
    "brush_drop": ("electrical", ("current",)),
    "flux_saturation": ("electrical", ("current",)),
    "inductance_saturation": ("electrical", ("current",)),
    "self_heating": ("thermal", ("current",)),
    "winding_lag": ("thermal", ("temperature",)),
    "magnet_lag": ("thermal", ("temperature",)),
    "resistance_curvature": ("thermal", ("temperature",)),
    "demagnetization": ("thermal", ("temperature", "time")),
    "current_offset": ("sensor", ()),
    "voltage_offset": ("sensor", ()),
    "speed_offset": ("sensor", ()),
    "channel_delay": ("sensor", ("time",)),
    "speed_filter": ("sensor", ("speed",)),
    "current_filter": ("sensor", ("current",)),
    "input_hold": ("sensor", ("voltage",)),
}
VALUES = np.array([0.6, 0.0039, 0.07, -0.0012, 1e-4, 1e-4, 2e-3])


def _records() -> list[Record]:
    rng = np.random.default_rng(3)
    runs = []
    for k in range(2):
        n = 400
        voltage = np.repeat(rng.uniform(-20, 20, n // 20), 20)
        time = np.arange(n, dtype=np.float64) * 1e-3
        current = np.sin(0.05 * np.arange(n)) * 5
        speed = np.cos(0.02 * np.arange(n)) * 150
        runs.append(Run(f"{k}.csv", "", time, voltage, current, speed, 25 + 20 * k + 30 * time))
    return records_of(runs)


def _scales() -> CampaignScales:
    return CampaignScales(
        records=tuple(_records()),
        current=4.0,
        speed=120.0,
        voltage=12.0,
        torque=0.28,
        interval=1e-3,
        duration=0.4,
        values=VALUES,
        angle_logged=False,
    )


def _candidates(name: str) -> list[Candidate]:
    return CATALOGUE[name].candidates(_scales())


def test_the_catalogue_begins_with_the_effects_that_users_script_against() -> None:
    """The names are those of the published interface, in the order that decides ties."""
    assert list(CATALOGUE)[: len(CONTRACT)] == list(CONTRACT)


def test_the_schema_of_a_result_names_every_effect() -> None:
    """The search reports an effect of the catalogue, or `unlisted`."""
    names = result_schema()["$defs"]["EffectEntry"]["properties"]["name"]["enum"]

    assert names == [*CATALOGUE, "unlisted"]


def test_a_second_effect_of_a_name_is_refused() -> None:
    """The message names both classes, and the first class remains."""
    first = CATALOGUE["brush_drop"]
    second = type("Other", (first,), {"__module__": "elsewhere"})

    with pytest.raises(ValueError, match=r"'brush_drop' of elsewhere .*electrical\.BrushDrop"):
        register(second)

    assert CATALOGUE["brush_drop"] is first


@pytest.mark.parametrize("name", CONTRACT)
def test_each_effect_is_in_the_equation_and_has_the_drivers_that_are_published(name: str) -> None:
    """Equation and drivers are those of the published table."""
    kind = CATALOGUE[name]
    term = _candidates(name)[0].term

    assert kind.name == name
    assert (term.equation, term.drivers) == CONTRACT[name]
    assert kind.source
    assert kind.__doc__


@pytest.mark.parametrize("name", CATALOGUE)
def test_each_effect_offers_prototypes_inside_its_own_bounds(name: str) -> None:
    """The fit would move a start outside the bounds."""
    candidates = _candidates(name)

    assert candidates
    for candidate in candidates:
        for parameter, row in zip(candidate.term.parameters, candidate.starts, strict=True):
            assert np.all(row >= parameter.lower), parameter.name
            assert np.all(row <= parameter.upper), parameter.name


@pytest.mark.parametrize("name", CATALOGUE)
def test_each_prototype_changes_what_the_sensors_log(name: str) -> None:
    """A prototype without any effect on two moving runs could never be found."""
    records = _records()
    base = Simulator.fitting(MotorModel(), records, VALUES)
    states = [initial_states(MotorModel(), record) for record in records]
    known = base.logged(VALUES[:, None], states)

    for candidate in _candidates(name)[:1]:
        model = MotorModel().adding(candidate.term)
        count = max(candidate.starts.shape[1], 1)
        values = np.concatenate(
            [np.repeat(VALUES[:, None], count, axis=1), candidate.starts.reshape(-1, count)]
        )
        simulator = Simulator.fitting(model, records, values[:, 0])
        logged = simulator.logged(values, [initial_states(model, record) for record in records])

        for lane in range(count):
            change = sum(
                float(np.nanmax(np.abs(y[:, :, lane] - b[:, :, 0])))
                for y, b in zip(logged, known, strict=True)
            )
            assert change > 0


@pytest.mark.parametrize(
    "name",
    [
        "coulomb_friction",
        "quadratic_drag",
        "load_torque",
        "brush_drop",
        "flux_saturation",
        "inductance_saturation",
        "resistance_curvature",
        "viscous_temperature",
        "demagnetization",
        "current_offset",
        "speed_offset",
        "voltage_offset",
        "inertia_change",
    ],
)
def test_an_effect_of_no_size_leaves_the_declared_equations_as_they_are(name: str) -> None:
    """By definition the rates at zero amplitude are those of the nominal model."""
    candidate = _candidates(name)[0]
    model = MotorModel().adding(candidate.term)
    x, u = ca.SX.sym("x", len(model.state_names)), ca.SX.sym("u", len(INPUTS))
    p = ca.SX.sym("p", len(model.parameters))
    both = ca.Function("both", [x, u, p], [model.rates(x, u, p), model.logged(x, u, p)])
    d = ca.SX.sym("d", 7)
    plain = ca.Function(
        "plain", [x, u, d], [MotorModel().rates(x, u, d), MotorModel().logged(x, u, d)]
    )
    start = candidate.starts[:, 0].copy()
    for row, parameter in enumerate(candidate.term.parameters):
        if parameter.search == "linear":
            start[row] = 0.0
            break
    inputs = [1e-3, 10.0, 12.0, 60.0, 61.0, 0.3, 0.4, 0.1, 0.0, 70.0, 0.0, 1.0, 2.0, 0.1]

    found = both([2.0, 50.0], inputs, np.concatenate([VALUES, start]))

    expected = plain([2.0, 50.0], inputs, VALUES)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-12)


def _equations(terms: tuple[AbstractEffect, ...]) -> dict[str, float]:
    """Rates of the states and readings of the sensors at one point, by name."""
    model, rng = MotorModel(terms), np.random.default_rng(5)
    names = [p.name for p in model.parameters]
    own = [p.prior_mean + 0.3 * p.scale for term in terms for p in term.parameters]
    values = dict(zip(names, [*VALUES, *own], strict=True))
    points = {name: float(rng.uniform(0.1, 0.9)) for name in INPUTS}
    where = {name: 1.0 + 0.1 * (sum(map(ord, name)) % 7) for name in model.state_names}
    symbols = model.symbols()
    equations = ca.Function("equations", list(symbols), list(model.assembled(*symbols)))
    at = ([where[name] for name in model.state_names], list(points.values()), list(values.values()))
    rates, readings = (np.asarray(found).ravel() for found in equations(*at))
    found = dict(zip(model.state_names, rates, strict=True))
    return found | dict(zip(("logged current", "logged speed"), readings, strict=True))


def test_effects_act_in_the_same_way_in_whichever_order_they_are_added() -> None:
    """A filter of a sensor, added after its zero error, keeps that error."""
    laws: dict[str, dict[str, AbstractEffect]] = {}
    for kind in (*CATALOGUE.values(), *SURROGATES, *LAWS):
        for candidate in kind.candidates(_scales()):
            laws.setdefault(candidate.final.name, {})[candidate.final.variant] = candidate.final
    for k in range(max(map(len, laws.values()))):
        terms = tuple(list(own.values())[k % len(own)] for own in laws.values())

        assert _equations(terms) == pytest.approx(_equations(terms[::-1]), rel=1e-12)


def test_every_effect_with_amplitudes_of_each_record_takes_their_prior() -> None:
    """The prior standard deviation is that of the states that are amplitudes of a record."""
    kinds = [*CATALOGUE.values(), *SURROGATES]
    terms = [candidate.term for kind in kinds for candidate in kind.candidates(_scales())]
    terms += [variant for term in terms for variant in term.richer]
    free = [term for term in terms if any(state.is_own for state in term.states)]
    assert free
    for term in free:
        own = [state for state in term.expecting(7.5).states if state.is_own]
        assert own, term.name
        assert {state.scale for state in own} == {7.5}, term.name

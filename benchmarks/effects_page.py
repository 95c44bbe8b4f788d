"""Generator of the documentation page on effects, from the catalogue classes.

    python -m benchmarks.effects_page

writes docs/effects.md.

Each class of the catalogue provides its description, formula, drivers, parameters and source, so
that the page repeats nothing by hand.  Priors scale with the motor at hand; the page shows those of
an example motor.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Final

import numpy as np

from identification.effects.catalogue import CATALOGUE, confusions
from identification.effects.effect import AbstractEffect, CampaignScales
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.parameter import Parameter
from identification.model.simulate import Simulator, initial_states
from identification.result.atomic import write_text
from identification.selection.candidates import scales_of

__all__ = ["EXAMPLE_MOTOR", "effects_page", "example_scales", "main"]

PAGE: Final = Path("docs/effects.md")

EXAMPLE_MOTOR: Final = (0.6, 0.0039, 0.07, -0.0012, 1e-4, 1e-4, 2e-3)
"""Ra25, alpha_Ra, Kt25, alpha_Kt, J, b and L of the example: a servo motor of 100 W at 24 V."""

_INTERVAL: Final = 1e-3
_ROWS: Final = 4000

_HEAD: Final = """\
# Effects

The effect types that motorid searches for in addition to the nominal model, with their names in \
result.json.
`python -m benchmarks.effects_page` generates this page from the classes in \
`identification/effects/`.

An effect type is a family of laws and not a single formula: shape parameters cover the deviation \
of real motors from the textbook law.
Each effect adds a voltage or a torque to one of the two balances,

```text
L di/dt = v - Ra(T) i - Kt(T) w + voltage          Ra(T) = Ra25 (1 + alpha_Ra (T - 25))
J dw/dt = Kt(T) i - b w + torque                   Kt(T) = Kt25 (1 + alpha_Kt (T - 25))
```

changes a coefficient or its temperature, or acts in a sensor.
[Decision 0008](adr/0008-three-gates-for-an-effect.md) defines the acceptance criteria of an \
effect.
If no effect type meets them, the search may fit the effect `unlisted`: a smooth curve of the \
missing voltage or torque over the signals that it depends on most.
Thirteen physical laws have the name `unlisted` as well: a sagging chopper supply if the logged \
voltage is the commanded one, v = -R_s (v / v_0)^2 i; a ripple of the speed sensor over the shaft \
angle phi, from a tachogenerator or an eccentric disc, w (1 + sum A_h sin(h k phi) + B_h cos(h k \
phi)); the saturation of the current sensor, i / (1 + c |i / i_0|^2p)^(1/2p); a dead zone of the \
current or the speed sensor, x - d sgn x beyond d and 0 within; the friction of a gear in \
proportion to the torque that accelerates the load, -c |J dw/dt| sgn w; a viscous friction -c w \
or a dry friction -c sgn w with another c in each run, as of bearings that run in; a return \
spring, -k phi; and another gain of the current sensor, i (1 + g), of the speed sensor, w (1 + \
g), or of the voltage, v (1 + g), another resistance, Ra (1 + g), or another torque constant, Kt \
(1 + g), in some runs or in each.

Priors scale with the signals of the runs and with the fit of the nominal model.
The priors below belong to an example: a servo motor with Ra25 {Ra25:g} ohm, Kt25 {Kt25:g} N m/A \
and J {J:g} kg m^2; runs with RMS values of {voltage} V, {current} A and {speed} rad/s, a \
duration of {duration} s and a sample interval of {interval:g} ms.
A prior "x / f" is log-normal with median x; one standard deviation is a factor of f.

The plots show what an effect of typical size adds to this motor, simulated by \
`python -m benchmarks.effects_plots`: the missing torque or voltage over the driver \
if it follows the driver, else the change of the logged current and speed over time, during a \
fast sweep of the voltage (0 to 2 s) and steps (2 to 4 s), while the temperature rises from 25 to \
65 degC.
"""


def effects_page(scales: CampaignScales) -> str:
    """Markdown text of the page."""
    ra, _, kt, _, inertia, *_ = EXAMPLE_MOTOR
    head = _HEAD.format(
        Ra25=ra, Kt25=kt, J=inertia, voltage=_number(scales.voltage),
        current=_number(scales.current), speed=_number(scales.speed),
        duration=_number(scales.duration), interval=1e3 * scales.interval,
    )  # fmt: skip
    index = ["| effect | equation | drivers | description |", "|---|---|---|---|"]
    sections = []
    for name, kind in CATALOGUE.items():
        documentation = _documentation(kind)
        term = kind.candidates(scales)[0].term
        drivers = ", ".join(term.drivers) or "none (constant)"
        index.append(f"| [`{name}`](#{name}) | {kind.equation} | {drivers} | {documentation[0]} |")
        sections.append(_section(term, documentation, drivers))
    return "\n".join([head, *index, "", *sections, _confusions()])


def example_scales() -> CampaignScales:
    """Signal and parameter scales of an example with varying temperature and a logged shaft angle.

    A known motor is simulated, noise is added and the nominal model is fitted, as for any runs.
    """
    rng = np.random.default_rng(0)
    time = _INTERVAL * np.arange(_ROWS, dtype=np.float64)
    values = np.array(EXAMPLE_MOTOR)
    runs = []
    for number in range(2):
        voltage = np.repeat(rng.uniform(-24.0, 24.0, _ROWS // 50), 50)
        temperature = 25.0 + 40.0 * number + 20.0 * time / time[-1]
        still = np.zeros(_ROWS)
        silent = Run(f"run_{number}.csv", "0" * 64, time, voltage, still, still, temperature, still)
        records = records_of([silent])
        simulator = Simulator.fitting(MotorModel(), records, values)
        states = [initial_states(MotorModel(), record) for record in records]
        current, speed = simulator.logged(values[:, None], states)[0][:, :, 0].T
        runs.append(
            Run(
                silent.name, silent.sha256, time, voltage,
                current + 0.02 * rng.standard_normal(_ROWS),
                speed + 0.2 * rng.standard_normal(_ROWS),
                temperature, np.cumsum(speed) * _INTERVAL,
            )
        )  # fmt: skip
    return scales_of(fit_declared(records_of(runs), "zoh"))


def main() -> None:
    """Write the page, from the root of the project."""
    write_text(PAGE, effects_page(example_scales()))


def _documentation(kind: type[AbstractEffect]) -> tuple[str, list[str], str]:
    """First sentence, formulas and remaining text of a class docstring."""
    whole = inspect.cleandoc(kind.__doc__ or "")
    body = re.split(r"^Args:|^Source:", whole, maxsplit=1, flags=re.MULTILINE)[0].strip()
    first, *rest = re.split(r"\n\s*\n", body)
    first = " ".join(first.split())
    formulas, remarks = [], []
    for paragraph in rest:
        lines = paragraph.splitlines()
        is_formula = all(line.startswith(" ") for line in lines) or _FORMULA.search(lines[0])
        if is_formula:
            formulas.append("\n".join(re.sub(r"^ {4}", "", line) for line in lines))
        else:
            remarks.append(" ".join(paragraph.split()))
    if ":" in first and "=" in first:
        # Move a formula out of the first sentence to a line of its own.
        sentence, formula = first.rstrip(".").split(":", 1)
        first, formulas = f"{sentence}.", [formula.strip(), *formulas]
    return first, formulas, "\n".join(remarks)


_FORMULA: Final = re.compile(r"(=|->).*\[[^\]]+\]\s*$")


def _section(term: AbstractEffect, documentation: tuple[str, list[str], str], drivers: str) -> str:
    text, formulas, remark = documentation
    lines = [f"## {term.name}", "", text]
    if formulas:
        lines += ["", "```text", *formulas, "```"]
    if remark:
        lines += ["", remark]
    lines += ["", f"![Signature of {term.name}](pictures/effects/{term.name}.svg)"]
    lines += ["", f"Equation: {term.equation}. Drivers: {drivers}."]
    lines.append(f"Source: {term.source}.")
    if term.parameters:
        lines += ["", "| parameter | unit | meaning | prior | bounds |", "|---|---|---|---|---|"]
        lines += [_row(parameter) for parameter in term.parameters]
    else:
        lines += ["", "No parameters."]
    if term.states:
        words = ", ".join(f"{state.name} [{state.unit}]" for state in term.states)
        lines += ["", f"Additional states, with a free initial value in each record: {words}."]
    return "\n".join([*lines, ""])


def _row(parameter: Parameter) -> str:
    return (
        f"| `{parameter.name}` | {parameter.unit} | {parameter.meaning} | {_prior(parameter)} | "
        f"{_bounds(parameter)} |"
    )


def _prior(parameter: Parameter) -> str:
    if not np.isfinite(parameter.prior_sd):
        return "flat"
    if parameter.search == "log":
        return f"{_number(parameter.prior_mean)} / {_number(float(np.exp(parameter.prior_sd)))}"
    spread = f"normal, sd {_number(parameter.prior_sd * parameter.scale)}"
    mean = f" about {_number(parameter.prior_mean)}" if parameter.prior_mean else ""
    return f"{spread}{mean}"


def _bounds(parameter: Parameter) -> str:
    low, high = parameter.lower, parameter.upper
    if not np.isfinite(low) and not np.isfinite(high):
        return "none"
    if not np.isfinite(high):
        return f"at least {_number(low)}"
    return f"{_number(low)} to {_number(high)}"


def _number(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def _confusions() -> str:
    lines = [
        "## Known confusions",
        "",
        "Confounded effects and parameters: they change the logged signals in nearly the same way.",
        "These limits are physical; no method removes them.",
        "A report lists those that concern its effects, and gives alternatives that the runs "
        "cannot separate with their probabilities.",
        "",
        "| confounded quantities | effects | parameters | how to separate them |",
        "|---|---|---|---|",
    ]
    for confusion in confusions():
        names = [name for name, kind in CATALOGUE.items() if confusion in kind.confusions]
        effects = ", ".join(f"[`{name}`](#{name})" for name in names)
        parameters = ", ".join(f"`{name}`" for name in confusion.parameters)
        lines.append(f"| {confusion.title} | {effects} | {parameters} | {confusion.apart} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()

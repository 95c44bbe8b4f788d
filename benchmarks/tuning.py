"""Controllers of three identified motors and one with sticky grease, tuned to a specification.

    python -m benchmarks.tuning [--out docs/benchmarks/tuning.md]

Fits the source's motor and the servo of data/, and the servo of the bench simulator with dry
friction; tunes all kinds of controllers for each; and judges a slow loop of a servo whose friction
fades at 2 rad/s.  Writes the page and its figure beside docs/pictures/.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.campaign import EffectRequest, make_campaign
from identification.effects.friction import CoulombFriction, StribeckFriction
from identification.model.composite import MotorModel
from identification.options import FitOptions
from identification.pipeline import identify
from identification.reporting.svg import Frame, axes, line, svg, svg_file
from identification.result.atomic import write_text
from identification.tuning import KINDS, UncertainMotor, motor_of, parse_specification, tune

__all__ = ["main"]

_PICTURE: Final = Path("docs/pictures/tuning.svg")
_DATA: Final = Path("data")
_RANGE: Final = (0.0, 30.0, 60.0, 90.0, 120.0)
_SERVO_SPEC: Final = (
    "rise_time=0.02,settling_time=0.1,overshoot=10,phase_margin=45,gain_margin=6,steady_error=1,"
    "current=8,voltage=36,sample_time=1e-3,delay=5e-4"
)
_WIDTH: Final = 330
_HEIGHT: Final = 200
_STYLE: Final = (
    "text{font:12px sans-serif;fill:#777}.mid{text-anchor:middle}.end{text-anchor:end}"
    ".frame{fill:none;stroke:#999}.grid{stroke:#9994}.line,.hot{fill:none;stroke:#1e88e5;"
    "stroke-width:1.8}.hot{stroke:#e53935}"
)


@dataclass(frozen=True)
class Case:
    """Motor with a specification.

    Args:
        title: Heading.
        specification: As `motorid tune --spec` takes it.
        effects: Effects of a new campaign of the 150 W servo; None for a campaign of data/.
        campaign: Folder in data/.
        controllers: Controllers to judge instead of tuning.
        step: Step of the reference [rad/s].
    """

    title: str
    specification: str
    effects: tuple[EffectRequest, ...] | None = None
    campaign: str = ""
    controllers: tuple[str, ...] = ()
    step: float = 100.0


_CASES: Final = (
    Case(
        "Motor of the source (Table 1)",
        "rise_time=0.4,settling_time=1,overshoot=5,phase_margin=55,gain_margin=6,steady_error=1,"
        "current=38,voltage=24,sample_time=1e-2,delay=5e-3",
        campaign="paper_motor",
        step=8.0,
    ),
    Case("Servo with brush drop", _SERVO_SPEC, campaign="brush_drop_servo"),
    Case(
        "Servo with dry friction",
        _SERVO_SPEC,
        effects=(
            EffectRequest("coulomb_friction", 0.05, "sign"),
            EffectRequest("stribeck_friction", 0.1, "gaussian"),
        ),
    ),
    Case(
        "Servo with grease that sticks, given by values",
        "settling_time=0.1,sample_time=1e-3,delay=5e-4,current=8,voltage=36",
        controllers=("P:0.1", "PI:0.02,2", "PI:0.3,20"),
    ),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit, tune, and write page and figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--out", type=Path, help="Markdown page to write; default: print it")
    given = parser.parse_args(arguments)
    found = [_tuned(case) for case in _CASES]
    page = _page(found)
    if given.out is None:
        print(page)
        return
    write_text(given.out, page)
    write_text(_PICTURE, _figure(found) + "\n")


def _tuned(case: Case) -> dict[str, Any]:
    """Content of the file of `motorid tune`."""
    return tune(
        _motor(case),
        parse_specification(case.specification),
        temperatures=_RANGE,
        kinds=tuple(KINDS),
        controllers=case.controllers,
        step=case.step,
    )


def _motor(case: Case) -> UncertainMotor:
    if case.controllers:
        terms = (CoulombFriction(0.4, 0.1), StribeckFriction(0.4, 300.0, 0.1))
        values = [1.1, 0.0039, 0.115, -0.0012, 1.2e-4, 6e-5, 2.6e-3, 0.02, 0.0, 0.06, 2.0, 2.0]
        return UncertainMotor(MotorModel(terms), np.array(values)[:, None])
    options = FitOptions(effort="quick")
    with tempfile.TemporaryDirectory() as temporary:
        folder = _DATA / case.campaign
        if case.effects is not None:
            folder = Path(temporary)
            make_campaign("servo_150w", case.effects, 31, rows=5000).write(folder)
        training, validation = (
            sorted(folder.glob(f"{role}_*.csv")) for role in ("training", "validation")
        )
        found = identify(training, validation, options)
    return motor_of(found.draws(), found.result)


def _page(found: Sequence[dict[str, Any]]) -> str:
    lines = [
        "# Tuned controllers",
        "",
        "Made by `python -m benchmarks.tuning --out docs/benchmarks/tuning.md`.",
        "[Tune](../tune.md) defines the specification, the simulated loop and the probability.",
        "The fits are those of `--effort quick`; the temperatures are 0 to 120 °C.",
        "",
        "![Step responses](../pictures/tuning.svg)",
        "",
        "Speed over reference with the recommended controller of each fitted motor, median at 0 °C "
        "(blue) and at 120 °C (red).",
    ]
    for case, one in zip(_CASES, found, strict=True):
        effects = ", ".join(name.replace("_", " ") for name in one["effects"]) or "none"
        lines += [
            "",
            f"## {case.title}",
            "",
            f"Specification: `{case.specification}`; step {case.step:g} rad/s; effects in the "
            f"loop: {effects}; {one['draws']} draws.",
            f"Recommended: {one['recommended'] or 'none'}.",
            "",
            "| controller | probability | rise [s] | settling [s] | overshoot [%] | phase margin "
            "[deg] | limits reached |",
            "|---|---|---|---|---|---|---|",
        ]
        lines += [_row(entry) for entry in one["controllers"]]
        lines += ["", *(f"- {entry['statement']}." for entry in one["controllers"])]
    return "\n".join(lines) + "\n"


def _row(entry: dict[str, Any]) -> str:
    """Probability and the range of each metric over draws and temperatures."""
    cells = [f"{entry['probability']:.3f}"]
    for name in ("rise_time", "settling_time", "overshoot", "phase_margin"):
        ends = [
            at[name][end]
            for at in entry["temperatures"]
            for end in ("q05", "q95")
            if at[name][end] is not None
        ]
        cells.append(f"{min(ends):.3g} to {max(ends):.3g}" if ends else "–")
    cells.append(f"{100 * entry['limit_active_probability']:.0f} %")
    return f"| {entry['controller']} | {' | '.join(cells)} |"


def _figure(found: Sequence[dict[str, Any]]) -> str:
    shown = [
        (case.title, entry, one["step_rad_s"])
        for case, one in zip(_CASES, found, strict=True)
        for entry in one["controllers"]
        if entry["controller"] == one["recommended"] and not case.controllers
    ]
    marks = ""
    for number, (title, entry, step) in enumerate(shown):
        time = np.array(entry["responses"][0]["time_s"])
        frame = Frame((72.0, 10.0, 240.0, 150.0), (0.0, float(time[-1])), (0.0, 1.15))
        curves = axes(frame, f"time [s] ({title})", "speed over reference [-]")
        for response, kind in zip(entry["responses"], ("line", "hot"), strict=True):
            curves += line(frame, time, np.array(response["speed"]["median"]) / step, kind)
        marks += f'<g transform="translate({_WIDTH * number} 0)">{curves}</g>'
    width = _WIDTH * len(shown)
    drawing = svg(width, _HEIGHT, "Step responses of tuned loops", "Speed over time.", marks)
    return svg_file(drawing, _STYLE)


if __name__ == "__main__":
    main()

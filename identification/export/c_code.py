"""C export: one self-contained file with the integration step of `predict`.

The step is the exponential Rosenbrock step of the simulation, printed from the same expression, so
equal substeps give equal numbers.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Final

import casadi as ca
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from identification.export.accuracy import substep_errors
from identification.export.language import C, printed
from identification.export.model import Exported
from identification.model.history import initial_history

__all__ = ["TEMPLATES", "c_code"]

TEMPLATES: Final = Environment(  # noqa: S701  source code, not HTML
    loader=PackageLoader("identification.export"),
    undefined=StrictUndefined,
    trim_blocks=True,
    keep_trailing_newline=True,
)
TEMPLATES.globals["version"] = version("motorid")

_ENOUGH: Final = 1e-6
"""Error over the range of the signal of the default number of substeps."""


def c_code(motor: Exported, header: list[str]) -> str:
    """Text of the C file."""
    step = motor.step
    x, u, p = (ca.SX.sym(name, step.size1_in(k)) for k, name in enumerate("xup"))
    following, readings = step(x, u, p)
    names = ["x", "u", "p"]
    advance = printed(ca.Function("advance", [x, u, p], [following]), C, names, ["y"])
    sensors = printed(ca.Function("sensors", [x, u, p], [readings]), C, names, ["y"])
    errors = substep_errors(step, motor.model, motor.values, motor.interval, motor.span)
    enough = [count for count, error in errors.items() if error <= _ENOUGH]
    # Markers in place of the readings show which channel each history value starts at.
    history = initial_history(motor.model, np.array([1.0, 2.0]))
    marked = {0.0: "zero", 1.0: "current", 2.0: "speed"}
    return TEMPLATES.get_template("motor.c").render(
        header=[line.replace("*/", "* /") for line in header],
        errors=[(n, e) for n, e in errors.items() if n == 1 or n <= 2 * min(enough, default=256)],
        substeps=min(enough, default=max(errors)),
        states=motor.model.state_names,
        carry=step.size1_in(0),
        parameters=motor.parameters,
        interval=repr(motor.interval),
        span=motor.span.tolist(),
        peak=motor.peak,
        held=motor.model.held,
        advance=advance.text,
        sensors=sensors.text,
        starts=[*motor.starts, *(marked[value] for value in history.tolist())],
    )

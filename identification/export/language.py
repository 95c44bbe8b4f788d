"""Printer of CasADi expressions as assignments in the language of another program.

One walk over the instructions of an SX function serves all languages; a `Language` has the
spelling of each operation.  A value that is used more than once becomes a local variable, all
others are written where they are used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import casadi as ca

from identification.errors import ComputationError

__all__ = ["C", "MATLAB", "MODELICA", "PYTHON", "Language", "Printed", "printed"]

_LONGEST: Final = 400
"""Length of an expression from which it becomes a local variable [characters]."""

_UNARY: Final = ("exp", "log", "sin", "cos", "tanh", "sqrt", "floor", "ceil", "fabs")
_BINARY: Final = ("pow", "fmin", "fmax", "copysign")

_COMMON: Final[Mapping[int, str]] = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "({0} + {1})",
    ca.OP_SUB: "({0} - {1})",
    ca.OP_MUL: "({0} * {1})",
    ca.OP_DIV: "({0} / {1})",
    ca.OP_NEG: "(-{0})",
    ca.OP_SQ: "({0} * {0})",
    ca.OP_TWICE: "(2.0 * {0})",
    ca.OP_INV: "(1.0 / {0})",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    **{getattr(ca, f"OP_{name.upper()}"): f"{name}({{0}})" for name in _UNARY},
    **{getattr(ca, f"OP_{name.upper()}"): f"{name}({{0}}, {{1}})" for name in _BINARY},
}
"""Spelling of most operations; functions have their names in C."""

_SHORT_NAMES: Final[Mapping[int, str]] = {
    ca.OP_FABS: "abs({0})",
    ca.OP_FMIN: "min({0}, {1})",
    ca.OP_FMAX: "max({0}, {1})",
}
_CARET: Final[Mapping[int, str]] = {
    **_SHORT_NAMES,
    ca.OP_POW: "({0})^({1})",
    ca.OP_CONSTPOW: "({0})^({1})",
    ca.OP_SIGN: "sign({0})",
}


def _logic(number: str, both: str, either: str, differs: str = "!=") -> dict[int, str]:
    """Conditions as numbers zero and one, from a template with the condition as {0}."""
    conditions = {
        ca.OP_LT: "{0} < {1}",
        ca.OP_LE: "{0} <= {1}",
        ca.OP_EQ: "{0} == {1}",
        ca.OP_NE: f"{{0}} {differs} {{1}}",
        ca.OP_NOT: "{0} == 0.0",
        ca.OP_AND: f"{{0}} {differs} 0.0 {both} {{1}} {differs} 0.0",
        ca.OP_OR: f"{{0}} {differs} 0.0 {either} {{1}} {differs} 0.0",
    }
    return {operation: number.replace("{0}", text) for operation, text in conditions.items()}


@dataclass(frozen=True)
class Language:
    """Spelling of expressions and assignments."""

    operations: Mapping[int, str] = field(hash=False)
    """Template of each operation; {0} and {1} are the operands."""
    local: str
    """Template of a local variable: name and value."""
    output: str
    """Template of an output element: name, index from `first` and value."""
    index: str
    """Template of an element: name and index."""
    first: int = 0
    """Index of the first element of an array."""


C: Final = Language(
    {
        **_COMMON,
        **_logic("(double)({0})", "&&", "||"),
        ca.OP_SIGN: "(double)(({0} > 0.0) - ({0} < 0.0))",
        ca.OP_IF_ELSE_ZERO: "({0} != 0.0 ? {1} : 0.0)",
    },
    "    const double {0} = {1};",
    "    {0}[{1}] = {2};",
    "{0}[{1}]",
)

PYTHON: Final = Language(
    {
        **_COMMON,
        **_SHORT_NAMES,
        **_logic("float({0})", "and", "or"),
        ca.OP_SIGN: "float(({0} > 0.0) - ({0} < 0.0))",
        ca.OP_IF_ELSE_ZERO: "({1} if {0} != 0.0 else 0.0)",
    },
    "    {0} = {1}",
    "    {0}[{1}] = {2}",
    "{0}[{1}]",
)

MATLAB: Final = Language(
    {
        **_COMMON,
        **_CARET,
        **_logic("double({0})", "&&", "||", "~="),
        ca.OP_COPYSIGN: "(abs({0}) * (2.0 * double({1} >= 0.0) - 1.0))",
        ca.OP_IF_ELSE_ZERO: "where({0}, {1})",
    },
    "    {0} = {1};",
    "    {0}({1}) = {2};",
    "{0}({1})",
    1,
)

MODELICA: Final = Language(
    {
        **_COMMON,
        **_CARET,
        **_logic("(if {0} then 1.0 else 0.0)", "and", "or"),
        ca.OP_NE: "(if abs({0} - {1}) > 0.0 then 1.0 else 0.0)",
        ca.OP_EQ: "(if abs({0} - {1}) > 0.0 then 0.0 else 1.0)",
        ca.OP_NOT: "(if abs({0}) > 0.0 then 0.0 else 1.0)",
        ca.OP_AND: "(if abs({0}) > 0.0 and abs({1}) > 0.0 then 1.0 else 0.0)",
        ca.OP_OR: "(if abs({0}) > 0.0 or abs({1}) > 0.0 then 1.0 else 0.0)",
        ca.OP_COPYSIGN: "(if {1} >= 0.0 then abs({0}) else -abs({0}))",
        ca.OP_IF_ELSE_ZERO: "(if abs({0}) > 0.0 then {1} else 0.0)",
    },
    "  {0} := {1};",
    "  {0}[{1}] := {2};",
    "{0}[{1}]",
    1,
)


@dataclass(frozen=True)
class Printed:
    """Body of a printed function."""

    text: str
    """Assignments in their order, one per line."""
    local: tuple[str, ...]
    """Names of the local variables."""


def printed(
    function: ca.Function,
    language: Language,
    inputs: Sequence[str | Sequence[str]],
    outputs: Sequence[str],
) -> Printed:
    """Assignments that compute an SX function with dense vectors.

    An input has the name of its array or one of each element, an output that of its array.

    Raises:
        ComputationError: The function has an operation that the language lacks.
    """
    operations = [function.instruction_id(k) for k in range(function.n_instructions())]
    made, uses = _uses(function, operations)
    work: dict[int, str] = {}
    lines: list[str] = []
    local: list[str] = []
    for k, operation in enumerate(operations):
        target = function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[k] = _number(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            which, row = function.instruction_input(k)
            name = inputs[which]
            element = (name, row + language.first)
            work[k] = language.index.format(*element) if isinstance(name, str) else name[row]
        elif operation == ca.OP_OUTPUT:
            which, row = target
            value = work[made[k][0]]
            lines.append(language.output.format(outputs[which], row + language.first, value))
        else:
            if operation not in language.operations:
                raise ComputationError(
                    f"operation {operation} of a model has no translation for this export; "
                    "expected arithmetic, exp, log, sin, cos, tanh, sqrt, powers, comparisons or "
                    "if_else"
                )
            operands = [work[j] for j in made[k]]
            text = language.operations[operation].format(*operands)
            if uses[k] > 1 or len(text) > _LONGEST:
                name = f"a{len(local) + 1}"
                local.append(name)
                lines.append(language.local.format(name, text))
                text = name
            work[k] = text
    return Printed("\n".join(lines), tuple(local))


def _uses(
    function: ca.Function, operations: Sequence[int]
) -> tuple[dict[int, list[int]], Counter[int]]:
    """For each instruction those that make its operands, and how often its own value is used."""
    latest: dict[int, int] = {}
    made: dict[int, list[int]] = {}
    uses: Counter[int] = Counter()
    for k, operation in enumerate(operations):
        if operation not in (ca.OP_CONST, ca.OP_INPUT):
            made[k] = [latest[j] for j in function.instruction_input(k)]
            # A square writes its operand twice.
            uses.update(made[k] * (2 if operation == ca.OP_SQ else 1))
        if operation != ca.OP_OUTPUT:
            latest[function.instruction_output(k)[0]] = k
    return made, uses


def _number(value: float) -> str:
    """Shortest decimal that reads back as the same number, in brackets if negative."""
    text = repr(float(value))
    return f"({text})" if value < 0 else text

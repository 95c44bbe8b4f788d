"""List of CasADi's scalar operations, as it is read and simplified for a translation.

CasADi has no conditional value: `if_else(c, a, b)` is a sum of two products with a truth value,
`c ? a : 0` and `!c ? b : 0`, and its tangents are sums of `c da` and `!c db`.  Models with
histories and friction consist of hundreds of them, so each sum is translated as one choice.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

import casadi as ca

__all__ = ["translated", "without_repeats"]

Result = TypeVar("Result")
"""Translation of an expression."""

_CONSTANT, _INPUT, _OUTPUT, _ADD = ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_ADD
_TRUTHS: Final = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR}
"""Operations whose result is zero or one."""
_CHOICE: Final = -1
"""Code of a conditional value with operands condition, value and value otherwise."""


class _List(NamedTuple):
    """Operations of a function, each with a number; that with number 0 is the constant zero."""

    codes: list[int]
    operands: list[tuple[int, ...]]
    """Numbers of the operands of each operation."""
    constants: dict[int, float]
    """Value of each constant."""
    places: dict[int, list[int]]
    """Indices of input and row of each operation that reads an input."""
    outputs: list[list[int]]
    """Number of the operation of each element of each output."""


def translated(
    function: ca.Function,
    constant: Callable[[float], Result],
    given: Callable[[int, int], Result],
    operation: Callable[[int, list[Result]], Result],
    choice: Callable[[Result, Result, Result], Result] | None = None,
) -> list[list[Result]]:
    """Elements of each output of an SX function, from what its operations are translated to.

    An element of an input is given by the indices of input and row.  With `choice`, a conditional
    value is one operation.
    """
    listed = _listed(function)
    codes, operands = listed.codes, listed.operands
    if choice is not None:
        for k in [k for k, code in enumerate(codes) if code == _ADD]:
            codes[k], operands[k] = _choice_of(k, codes, operands)
    is_used = _used(operands, [number for rows in listed.outputs for number in rows])
    found: dict[int, Result] = {}
    for k, code in enumerate(codes):
        if not is_used[k]:
            continue
        if code == _CONSTANT:
            found[k] = constant(listed.constants[k])
        elif code == _INPUT:
            found[k] = given(*listed.places[k])
        elif code == _CHOICE and choice is not None:
            found[k] = choice(*[found[j] for j in operands[k]])
        else:
            found[k] = operation(code, [found[j] for j in operands[k]])
    return [[found[number] for number in rows] for rows in listed.outputs]


def _listed(function: ca.Function) -> _List:
    """Operations of a function in their order."""
    codes = [_CONSTANT]
    operands: list[tuple[int, ...]] = [()]
    constants, places = {0: 0.0}, dict[int, list[int]]()
    outputs = [[0] * function.size1_out(k) for k in range(function.n_out())]
    held: dict[int, int] = {}
    identify, targets, sources = (
        function.instruction_id, function.instruction_output, function.instruction_input,
    )  # fmt: skip
    for k in range(function.n_instructions()):
        code, target = identify(k), targets(k)
        if code == _OUTPUT:
            outputs[target[0]][target[1]] = held[sources(k)[0]]
            continue
        number = len(codes)
        own: tuple[int, ...] = ()
        if code == _CONSTANT:
            constants[number] = function.instruction_constant(k)
        elif code == _INPUT:
            places[number] = sources(k)
        else:
            own = tuple([held[j] for j in sources(k)])
        held[target[0]] = number
        codes.append(code)
        operands.append(own)
    return _List(codes, operands, constants, places, outputs)


def _choice_of(
    sum_: int, codes: list[int], operands: list[tuple[int, ...]]
) -> tuple[int, tuple[int, ...]]:
    """Code and operands of the choice that a sum of two conditional values is, or of the sum."""
    first, second = operands[sum_]
    for condition, chosen in _conditional(first, codes, operands):
        for other, otherwise in _conditional(second, codes, operands):
            if codes[other] == ca.OP_NOT and operands[other] == (condition,):
                return _CHOICE, (condition, chosen, otherwise)
            if codes[condition] == ca.OP_NOT and operands[condition] == (other,):
                return _CHOICE, (other, otherwise, chosen)
    return codes[sum_], operands[sum_]


def _conditional(
    number: int, codes: list[int], operands: list[tuple[int, ...]]
) -> list[tuple[int, int]]:
    """Condition and value of a node that is zero unless a condition holds; of a product, both."""
    if codes[number] == ca.OP_IF_ELSE_ZERO:
        condition, value = operands[number]
        return [(condition, value)]
    if codes[number] == ca.OP_MUL:
        a, b = operands[number]
        return [pair for pair in ((a, b), (b, a)) if codes[pair[0]] in _TRUTHS]
    return []


def _used(operands: list[tuple[int, ...]], wanted: list[int]) -> list[bool]:
    """True for each operation on which one of the wanted ones depends."""
    is_used = [False] * len(operands)
    for number in wanted:
        is_used[number] = True
    for k in range(len(operands) - 1, -1, -1):
        if is_used[k]:
            for j in operands[k]:
                is_used[j] = True
    return is_used


def without_repeats(function: ca.Function) -> ca.Function:
    """SX function that computes each repeated expression once; tangents have many."""
    given = function.sx_in()
    return ca.Function(function.name(), given, ca.cse(function.call(given)))

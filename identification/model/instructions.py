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

_TRUTHS: Final = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR}
"""Operations whose result is zero or one."""
_CHOICE: Final = -1
"""Code of a conditional value with operands condition, value and value otherwise."""


class _Node(NamedTuple):
    """One operation: its code, its operands by number, and the place or number that it reads."""

    code: int
    operands: tuple[int, ...] = ()
    place: tuple[int, ...] = ()
    number: float = 0.0


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
    nodes, outputs = _listed(function)
    if choice is not None:
        nodes = [_choice_of(node, nodes) for node in nodes]
    is_used = _used(nodes, [number for rows in outputs for number in rows])
    found: dict[int, Result] = {}
    for k, node in enumerate(nodes):
        if not is_used[k]:
            continue
        operands = [found[j] for j in node.operands]
        if node.code == ca.OP_CONST:
            found[k] = constant(node.number)
        elif node.code == ca.OP_INPUT:
            found[k] = given(*node.place)
        elif node.code == _CHOICE and choice is not None:
            found[k] = choice(*operands)
        else:
            found[k] = operation(node.code, operands)
    return [[found[number] for number in rows] for rows in outputs]


def _listed(function: ca.Function) -> tuple[list[_Node], list[list[int]]]:
    """Operations of a function, and the number of the operation of each element of its outputs."""
    nodes = [_Node(ca.OP_CONST)]
    held: dict[int, int] = {}
    outputs = [[0] * function.size1_out(k) for k in range(function.n_out())]
    identify, targets, sources = (
        function.instruction_id, function.instruction_output, function.instruction_input,
    )  # fmt: skip
    for k in range(function.n_instructions()):
        code, target = identify(k), targets(k)
        if code == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = held[sources(k)[0]]
            continue
        if code == ca.OP_CONST:
            node = _Node(code, number=function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            node = _Node(code, place=tuple(sources(k)))
        else:
            node = _Node(code, tuple(held[j] for j in sources(k)))
        held[target[0]] = len(nodes)
        nodes.append(node)
    return nodes, outputs


def _choice_of(node: _Node, nodes: list[_Node]) -> _Node:
    """The choice that a sum of two values with opposite conditions is, or the node itself."""
    if node.code != ca.OP_ADD:
        return node
    for condition, chosen in _conditional(nodes[node.operands[0]], nodes):
        for other, otherwise in _conditional(nodes[node.operands[1]], nodes):
            if nodes[other] == _Node(ca.OP_NOT, (condition,)):
                return _Node(_CHOICE, (condition, chosen, otherwise))
            if nodes[condition] == _Node(ca.OP_NOT, (other,)):
                return _Node(_CHOICE, (other, otherwise, chosen))
    return node


def _conditional(node: _Node, nodes: list[_Node]) -> list[tuple[int, int]]:
    """Condition and value of a node that is zero unless a condition holds; of a product, both."""
    if node.code == ca.OP_IF_ELSE_ZERO:
        return [(node.operands[0], node.operands[1])]
    if node.code == ca.OP_MUL:
        pairs = (node.operands, node.operands[::-1])
        return [(a, b) for a, b in pairs if nodes[a].code in _TRUTHS]
    return []


def _used(nodes: list[_Node], wanted: list[int]) -> list[bool]:
    """True for each operation on which one of the wanted ones depends."""
    is_used = [False] * len(nodes)
    for number in wanted:
        is_used[number] = True
    for k in range(len(nodes) - 1, -1, -1):
        if is_used[k]:
            for j in nodes[k].operands:
                is_used[j] = True
    return is_used


def without_repeats(function: ca.Function) -> ca.Function:
    """SX function that computes each repeated expression once; tangents have many."""
    given = function.sx_in()
    return ca.Function(function.name(), given, ca.cse(function.call(given)))

"""Model equations as text, printed from the CasADi expressions that are simulated."""

from __future__ import annotations

from typing import Final

import casadi as ca

from identification.model.composite import CHANNELS, INPUTS, MotorModel

__all__ = ["printed_equations"]

_INFIX: Final = {
    ca.OP_ADD: (" + ", 1),
    ca.OP_SUB: (" - ", 1),
    ca.OP_MUL: (" ", 2),
    ca.OP_DIV: (" / ", 2),
    ca.OP_LT: (" < ", 0),
    ca.OP_LE: (" <= ", 0),
    ca.OP_EQ: (" = ", 0),
}
_NAMED: Final = {
    ca.OP_SQRT: "sqrt",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "ln",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_FABS: "abs",
    ca.OP_TANH: "tanh",
    ca.OP_SIGN: "sgn",
}
_FUNCTIONS: Final = {ca.OP_IF_ELSE_ZERO: "where", ca.OP_FMIN: "min", ca.OP_FMAX: "max"}
_SYMBOLS: Final = {
    "current": "i",
    "speed": "w",
    "voltage": "v",
    "temperature": "T",
    "angle": "phi",
    "time": "t",
    "peak_temperature": "T_peak",
    "temperature_rate": "dT/dt",
}


def printed_equations(model: MotorModel) -> dict[str, str]:
    """Text of the state equations, and of the sensor equations that differ from the state itself.

    Args:
        model: The model.

    Returns:
        Left-hand side, such as ``di/dt`` or ``logged current``, to right-hand side.
    """
    state_names = [_SYMBOLS.get(name, name) for name in model.state_names]
    state, inputs, parameter = model.symbols()
    names = (
        state_names,
        [_SYMBOLS.get(name, name) for name in INPUTS],
        [p.name for p in model.parameters],
    )
    function = ca.Function(
        "equations",
        [state, inputs, parameter],
        [model.rates(state, inputs, parameter), model.logged(state, inputs, parameter)],
    )
    rates, logged = _texts(function, names)
    left = [f"d{name}/dt" for name in state_names]
    equations = dict(zip(left, rates, strict=True))
    for channel, symbol, text in zip(("current", "speed"), ("i", "w"), logged, strict=True):
        if text != symbol:
            equations[f"logged {channel}"] = text
    for k in model.averaged:
        equations[f"{CHANNELS[k]} channel"] = "mean over the sample interval that ends"
    for term in model.delays:
        equations[f"{term.channel} channel"] = f"logged {term.name}.delay later"
    return equations


def _texts(
    function: ca.Function, names: tuple[list[str], list[str], list[str]]
) -> tuple[list[str], list[str]]:
    work: dict[int, tuple[str, int]] = {}
    outputs: tuple[list[str], list[str]] = ([""] * function.size1_out(0), ["", ""])
    for k in range(function.n_instructions()):
        operation, target = function.instruction_id(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            value = function.instruction_constant(k)
            work[target[0]] = (f"{value:g}", 4 if value >= 0 else 0)
        elif operation == ca.OP_INPUT:
            which, row = function.instruction_input(k)
            work[target[0]] = (names[which][row], 4)
        elif operation == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = work[function.instruction_input(k)[0]][0]
        else:
            operands = [work[j] for j in function.instruction_input(k)]
            work[target[0]] = _written(operation, operands)
    return outputs


def _written(operation: int, operands: list[tuple[str, int]]) -> tuple[str, int]:
    first = operands[0]
    if operation in _INFIX:
        symbol, rank = _INFIX[operation]
        tight = operation in (ca.OP_SUB, ca.OP_DIV)
        left = _bracketed(first, rank)
        right = _bracketed(operands[1], rank + 1 if tight else rank)
        return f"{left}{symbol}{right}", rank
    if operation == ca.OP_NEG:
        return f"-{_bracketed(first, 2)}", 1
    if operation == ca.OP_SQ:
        return f"{_bracketed(first, 4)}^2", 3
    if operation == ca.OP_TWICE:
        return f"2 {_bracketed(first, 2)}", 2
    if operation == ca.OP_INV:
        return f"1 / {_bracketed(first, 3)}", 2
    if operation in (ca.OP_POW, ca.OP_CONSTPOW):
        return f"{_bracketed(first, 4)}^{_bracketed(operands[1], 4)}", 3
    if operation in _NAMED:
        return f"{_NAMED[operation]}({first[0]})", 4
    return f"{_FUNCTIONS.get(operation, 'f')}({', '.join(o[0] for o in operands)})", 4


def _bracketed(operand: tuple[str, int], rank: int) -> str:
    text, own = operand
    return text if own >= rank else f"({text})"

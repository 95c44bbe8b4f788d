"""LLVM loops over time around the instructions of a step function.

The plain loop repeats the step for each row of inputs.  The *interpolated* loop serves a linear
motor, whose state transition over a sample interval depends only on parameters and temperature.
The temperature varies slowly, so the transition is computed at every sixteenth row and
interpolated linearly in between, which leaves a few multiplications per row.
"""

from __future__ import annotations

from typing import Final

import casadi as ca

from identification.model.lowering import Translation

__all__ = ["STRIDE", "lower"]

STRIDE: Final = 16
"""Rows between two computed transitions of an interpolated loop."""

_HEAD: Final = (
    "define void @scan(i64 %n, i64 %stride, ptr noalias %inputs, ptr noalias %p, "
    'ptr noalias %carry, ptr noalias %outputs) "stackrealign" {'
)


_FIRST_BLOCK: Final = [
    "  %final = sub i64 %n, 2",
    "  %empty = icmp sle i64 %n, 0",
    "  br i1 %empty, label %done, label %begin",
    "begin:",
]


def lower(step: ca.Function, prepare: ca.Function | None, lanes: int) -> str:
    """LLVM module with a function ``scan`` that repeats `step` over time for a block of lanes.

    The step is an SX function (carry, input, parameter) -> (carry, output), `prepare` one (nothing,
    input, parameter) -> (nothing, prepared).  With `prepare` the step takes the prepared values,
    interpolated between the rows at which they are computed, in place of the parameters, and has no
    output.

    Raises:
        ComputationError: The step uses an operation that has no translation.
    """
    if prepare is not None:
        return _interpolated(step, prepare, lanes)
    body, vector = Translation(step, lanes), _vector(lanes)
    n_input, n_output, n_carry = step.size1_in(1), len(body.output), len(body.carry)
    stores: list[str] = []
    for row, name in enumerate(body.output):
        stores += [
            f"  %so{row} = mul i64 %stride, {row}",
            f"  %sa{row} = getelementptr double, ptr %y, i64 %so{row}",
            f"  store {vector} {name}, ptr %sa{row}, align 8",
        ]
    carried = [
        f"  %carry{row} = phi {vector} [ %cs{row}, %entry ], [ {name}, %loop ]"
        for row, name in enumerate(body.carry)
    ]
    return _text(
        sorted(body.declared),
        [_HEAD, "entry:"],
        _starts(n_carry, vector),
        body.lines["constant"],
        [
            f"  %row = mul i64 %stride, {n_output}",
            "  %empty = icmp sle i64 %n, 0",
            "  br i1 %empty, label %done, label %loop",
            "loop:",
            "  %k = phi i64 [ 0, %entry ], [ %k1, %loop ]",
            "  %u = phi ptr [ %inputs, %entry ], [ %u1, %loop ]",
            "  %y = phi ptr [ %outputs, %entry ], [ %y1, %loop ]",
        ],
        carried,
        body.lines["shared"],
        body.lines["lane"],
        stores,
        [
            "  %k1 = add i64 %k, 1",
            f"  %u1 = getelementptr double, ptr %u, i64 {n_input}",
            "  %y1 = getelementptr double, ptr %y, i64 %row",
            "  %more = icmp slt i64 %k1, %n",
            "  br i1 %more, label %loop, label %done",
        ],
        _ends(body.carry, vector, "loop"),
    )


def _interpolated(step: ca.Function, prepare: ca.Function, lanes: int) -> str:
    """Loop over blocks of rows; the last row has zero length and needs no transition."""
    body, vector = Translation(step, lanes, given=True), _vector(lanes)
    first = Translation(prepare, lanes, prefix="f", pointer="%inputs")
    last = Translation(prepare, lanes, prefix="g", pointer="%ue")
    n_input, n_carry = step.size1_in(1), len(body.carry)
    blocks, slopes, moved = [], [], []
    for row, (a, b) in enumerate(zip(first.output, last.output, strict=True)):
        blocks.append(f"  %h{row} = phi {vector} [ {a}, %entry ], [ {b}, %latch ]")
        slopes += [
            f"  %e{row} = fsub {vector} {b}, %h{row}",
            f"  %d{row} = fmul {vector} %e{row}, %share",
        ]
        moved += [
            f"  %m{row} = fmul contract {vector} %since, %d{row}",
            f"  %q{row} = fadd contract {vector} %h{row}, %m{row}",
        ]
    outer = [
        f"  %o{row} = phi {vector} [ %cs{row}, %entry ], [ {name}, %latch ]"
        for row, name in enumerate(body.carry)
    ]
    inner = [
        f"  %carry{row} = phi {vector} [ %o{row}, %outer ], [ {name}, %loop ]"
        for row, name in enumerate(body.carry)
    ]
    return _text(
        sorted(body.declared | first.declared | last.declared),
        [_HEAD, "entry:"],
        _starts(n_carry, vector),
        first.lines["constant"],
        last.lines["constant"],
        _FIRST_BLOCK,
        first.lines["shared"],
        first.lines["lane"],
        ["  br label %outer", "outer:", "  %k = phi i64 [ 0, %begin ], [ %kn, %latch ]"],
        [line.replace("%entry", "%begin") for line in (*blocks, *outer)],
        _block_bounds(n_input, lanes),
        last.lines["shared"],
        last.lines["lane"],
        slopes,
        _row_bounds(n_input, vector),
        inner,
        moved,
        body.lines["shared"],
        body.lines["lane"],
        _row_ends(n_input, lanes),
        _ends(body.carry, vector, "latch"),
    )


def _block_bounds(n_input: int, lanes: int) -> list[str]:
    """First and last row of a block, and the share of one row in it."""
    vector = _vector(lanes)
    return [
        "  %left = sub i64 %n, %k",
        f"  %short = icmp slt i64 %left, {STRIDE}",
        f"  %m = select i1 %short, i64 %left, i64 {STRIDE}",
        "  %stop = add i64 %k, %m",
        "  %over = icmp sgt i64 %stop, %final",
        "  %within = select i1 %over, i64 %final, i64 %stop",
        "  %behind = icmp slt i64 %within, %k",
        "  %end = select i1 %behind, i64 %k, i64 %within",
        "  %span = sub i64 %end, %k",
        "  %some = icmp sgt i64 %span, 0",
        "  %length = select i1 %some, i64 %span, i64 1",
        "  %number = sitofp i64 %length to double",
        "  %inverse = fdiv double 1.0, %number",
        f"  %single = insertelement {vector} poison, double %inverse, i64 0",
        f"  %share = shufflevector {vector} %single, {vector} poison, "
        f"<{lanes} x i32> zeroinitializer",
        f"  %eo = mul i64 %end, {n_input}",
        "  %ue = getelementptr double, ptr %inputs, i64 %eo",
    ]


def _row_bounds(n_input: int, vector: str) -> list[str]:
    """Begin of the loop over the rows of a block."""
    return [
        f"  %bo = mul i64 %k, {n_input}",
        "  %ub = getelementptr double, ptr %inputs, i64 %bo",
        "  br label %loop",
        "loop:",
        "  %j = phi i64 [ 0, %outer ], [ %j1, %loop ]",
        "  %u = phi ptr [ %ub, %outer ], [ %u1, %loop ]",
        f"  %since = phi {vector} [ zeroinitializer, %outer ], [ %since1, %loop ]",
    ]


def _row_ends(n_input: int, lanes: int) -> list[str]:
    """End of the loops over rows and blocks."""
    vector, ones = _vector(lanes), "<" + ", ".join(["double 1.0"] * lanes) + ">"
    return [
        f"  %since1 = fadd {vector} %since, {ones}",
        "  %j1 = add i64 %j, 1",
        f"  %u1 = getelementptr double, ptr %u, i64 {n_input}",
        "  %more = icmp slt i64 %j1, %m",
        "  br i1 %more, label %loop, label %latch",
        "latch:",
        "  %kn = add i64 %k, %m",
        "  %again = icmp slt i64 %kn, %n",
        "  br i1 %again, label %outer, label %done",
    ]


def _starts(n_carry: int, vector: str) -> list[str]:
    """Instructions that load the carry before the first row."""
    lines: list[str] = []
    for row in range(n_carry):
        lines += [
            f"  %co{row} = mul i64 %stride, {row}",
            f"  %ca{row} = getelementptr double, ptr %carry, i64 %co{row}",
            f"  %cs{row} = load {vector}, ptr %ca{row}, align 8",
        ]
    return lines


def _ends(carry: list[str], vector: str, behind: str) -> list[str]:
    """Instructions that store the carry after the last row, reached from the block `behind`."""
    found = [
        f"  %cf{row} = phi {vector} [ %cs{row}, %entry ], [ {name}, %{behind} ]"
        for row, name in enumerate(carry)
    ]
    stores = [f"  store {vector} %cf{row}, ptr %ca{row}, align 8" for row in range(len(carry))]
    return ["done:", *found, *stores, "  ret void", "}"]


def _vector(lanes: int) -> str:
    return f"<{lanes} x double>"


def _text(*parts: list[str]) -> str:
    return "\n".join([line for part in parts for line in part] + [""])

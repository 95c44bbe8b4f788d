"""Compilation of CasADi step functions into vectorised loops over time.

A motor model is a step function from the state and the inputs of one sample interval to the state
at the next sample.  A simulation repeats the step.  Likelihoods of many walkers, tangents for
Gauss-Newton, screening of effects and filtering repeat it too, with other quantities in the
*carry*.  CasADi represents the step as a flat list of scalar operations.  This module translates
the list into LLVM code that applies every operation to a block of *lanes* (walkers, tangent
directions, candidates), keeps the carry in registers and contains the loop over time.

CasADi's own virtual machine takes about a microsecond per step and lane.  Numba takes seconds to
compile each new model, and a search tries dozens.  LLVM compiles straight-line code in tens of
milliseconds, and the result is as fast as generated code can be.

An operation that depends on parameters alone runs once before the loop.  One that depends on inputs
alone runs once per step for all lanes.  Every other operation runs for every lane and step.

    scan = Scan(step)                        # step: (carry, input, parameter) -> (carry, output)
    carry, outputs = scan(inputs, parameters, carry)
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, Generic, Literal, TypeVar

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.instructions import without_repeats
from identification.model.interpreter import Interpreted
from identification.model.loop import STRIDE, lower
from identification.model.lowering import LANES
from identification.model.machine import Level, Loaded, compiled, vector_width
from identification.threads import threads
from identification.work import charge, charge_once

__all__ = [
    "COMPILED",
    "LANES",
    "SHORT",
    "Effort",
    "Recent",
    "Scan",
    "Task",
    "key_of",
    "padded",
    "run",
    "scan_of",
]

Effort = Literal["once", "few", "some", "most"]

Task = tuple[Loaded | Interpreted, tuple[int, ...]]
"""Kernel and its arguments."""

Kept = TypeVar("Kept")

COMPILED: Final = {"once": 2.5e5, "few": 2.5e5, "some": 5e5, "most": 1e6}
"""Operations that are charged for the compilation of one instruction, by effort."""

SHORT: Final = 1_000
"""Rows up to which a loop is not optimised.

Unoptimised code is generated in 7 instead of 21 microseconds per instruction, and takes up to 0.6
instead of 0.3 ns per instruction and block of lanes.  A fit runs a loop over some forty blocks."""

_BRIEF: Final = 7_000
"""Rows times blocks of lanes up to which a loop that runs once is interpreted: an interpreted
operation takes 3 ns, and its translation and compilation 20 microseconds."""

_LONG: Final = 40 * SHORT
"""Rows up to which a loop that runs a few times is not optimised."""

_WIDE: Final = max(LANES, 2 * vector_width())
"""Lanes of a wide block: two registers, as many as of AVX2 in a narrow one."""

_DURATION: Final = 1.5
"""Duration of a step in a wide block over that in a narrow one, at most."""

_OFTEN: Final = 20
"""Passes in narrow blocks before a loop is compiled for wide ones, which takes several times longer
than for narrow ones: a ranking of starting points is one pass, a sampler thousands."""

_ARGUMENTS: Final = (
    ctypes.c_int64,  # steps
    ctypes.c_int64,  # lanes, padded: the stride between rows of parameters, carry and outputs
    ctypes.c_void_p,  # inputs (n_step, n_input)
    ctypes.c_void_p,  # parameters (n_parameter, n_lane)
    ctypes.c_void_p,  # carry (n_carry, n_lane), overwritten
    ctypes.c_void_p,  # outputs (n_step, n_output, n_lane)
)


class Scan:
    """Step function compiled into a loop over time.

    Args:
        step: CasADi SX function with inputs carry (n_carry,), input (n_input,), parameter
            (n_parameter,) and outputs carry (n_carry,), output (n_output,).
        prepare: Optional SX function (nothing, input, parameter) -> (nothing, prepared) of slowly
            varying quantities; see `loop.lower`.
        effort: ``once`` for a loop that runs once, ``few`` for one that runs a few times, ``some``
            for one that runs in a fit, ``most`` for one that a sampler runs thousands of times.
        key: Key of the machine code in the cache on disk; None for no caching.
    """

    def __init__(
        self,
        step: ca.Function,
        prepare: ca.Function | None = None,
        effort: Effort = "most",
        key: str | None = None,
    ) -> None:
        self.n_carry, self.n_input, self.n_parameter = (step.size1_in(k) for k in range(3))
        self.n_output = step.size1_out(1)
        if step.size1_out(0) != self.n_carry:
            raise ValueError(
                f"the step takes a carry of {self.n_carry} and returns one of "
                f"{step.size1_out(0)}; expected equal lengths"
            )
        if prepare is not None:
            self._check_prepared(prepare)
            self.n_parameter = prepare.size1_in(2)
        own = step.n_instructions()
        self._operations = own + (prepare.n_instructions() / STRIDE if prepare is not None else 0.0)
        self._preparation = COMPILED[effort] * (own + (prepare.n_instructions() if prepare else 0))
        self._source, self._effort, self._key = (step, prepare), effort, key
        self._kernels: dict[tuple[Level | None, int], Loaded | Interpreted] = {}
        # Passes for which wide blocks would end first.
        self._suited = 0

    def _form(self, rows: Sequence[int], lanes: Sequence[int]) -> Level | None:
        """Form of the loop for records of so many rows and lanes; None if interpreted."""
        passes = sum(each * -(-wide // LANES) for each, wide in zip(rows, lanes, strict=True))
        if self._effort == "once" and passes <= _BRIEF and self._source[1] is None:
            return None
        most = _LONG if self._effort in ("once", "few") else SHORT
        return 0 if sum(rows) <= most else 2

    def _kernel(self, form: Level | None, lanes: int) -> Loaded | Interpreted:
        """Loop over a block of so many lanes, prepared at the first call."""
        step, prepare = self._source
        if (form, lanes) not in self._kernels:
            if form is None:
                self._kernels[form, lanes] = Interpreted(step)
            else:
                key = f"{self._key}{form}{lanes}" if self._key else None
                # Unoptimised code runs too rarely to repay the search for repeated expressions.
                made = without_repeats if form else lambda one: one
                code = compiled(lambda: lower(made(step), prepare, lanes), form, key)
                self._kernels[form, lanes] = Loaded(code, _ARGUMENTS)
        return self._kernels[form, lanes]

    def _width(self, form: Level | None, lanes: Sequence[int]) -> int:
        """Lanes of a block for records with so many lanes, wide if these end before narrow ones.

        Each thread takes one block after the other.  Wide code takes much longer to compile, so
        only loops that have run often use it.  The results of a lane are the same.
        """
        if form != 2 or self._effort != "most":
            return LANES
        blocks = [sum(-(-each // width) for each in lanes) for width in (_WIDE, LANES)]
        wide, narrow = (-(-number // threads()) for number in blocks)
        if not _DURATION * wide < narrow:
            return LANES
        self._suited += 1
        return _WIDE if self._suited > _OFTEN else LANES

    def _check_prepared(self, prepare: ca.Function) -> None:
        found = (prepare.size1_in(1), prepare.size1_out(1), self.n_output)
        if found != (self.n_input, self.n_parameter, 0):
            raise ValueError(
                f"inputs, prepared numbers and outputs are {found}; the step takes "
                f"{(self.n_input, self.n_parameter)} and must have no output"
            )

    def __call__(
        self, inputs: Sequence[Array], parameters: Sequence[Array] | Array, carries: Sequence[Array]
    ) -> tuple[list[Array], list[Array]]:
        """Run the loop over every record, in parallel over records and blocks of lanes.

        The inputs are (n_step, n_input) for each record, the parameters (n_parameter, n_lane) for
        all or for each one.  The carry (n_carry, n_lane) is that before the first step and is
        returned after the last one, with the outputs (n_step, n_output, n_lane).
        """
        tasks: list[Task] = []
        finals, outputs = [], []
        widths = [start.shape[1] for start in carries]
        form = self._form([rows.shape[0] for rows in inputs], widths)
        width = self._width(form, widths)
        if isinstance(parameters, np.ndarray):
            given = [padded(parameters)] * len(inputs)
        else:
            given = [padded(own) for own in parameters]
        keep: list[Array] = []
        for rows, aligned, start in zip(inputs, given, carries, strict=True):
            n_lane = start.shape[1]
            carry = padded(start)
            self._check(rows, aligned, carry)
            rows = np.ascontiguousarray(rows, dtype=np.float64)
            stride = carry.shape[1]
            output = np.empty((rows.shape[0], self.n_output, stride))
            keep.append(rows)
            for first, lanes in _blocks(stride, width):
                places = [each.ctypes.data + 8 * first for each in (aligned, carry, output)]
                task = (rows.shape[0], stride, rows.ctypes.data, *places)
                # The reference keeps the code loaded, even if another thread replaces the kernel.
                tasks.append((self._kernel(form, lanes), task))
            finals.append(carry[:, :n_lane])
            outputs.append(output[:, :, :n_lane])
        charge_once(self, self._preparation)
        for rows, start in zip(inputs, carries, strict=True):
            charge(self.work(rows.shape[0], start.shape[1]))
        run(tasks)
        return finals, outputs

    def work(self, rows: int, lanes: int) -> float:
        """Number of operations of one pass over `rows` rows and `lanes` lanes."""
        return self._operations * rows * LANES * -(-lanes // LANES)

    def _check(self, rows: Array, parameters: Array, carry: Array) -> None:
        found = (rows.shape[1], parameters.shape[0], carry.shape[0])
        expected = (self.n_input, self.n_parameter, self.n_carry)
        if found != expected or parameters.shape[1] != carry.shape[1]:
            raise ValueError(
                f"inputs, parameters and carry have {found} rows on {parameters.shape[1]} and "
                f"{carry.shape[1]} lanes; the step takes {expected} on equally many lanes"
            )


def scan_of(step: ca.Function, prepare: ca.Function | None = None, effort: Effort = "most") -> Scan:
    """Compiled loop of a step function; equal functions are compiled once and cached."""
    key = key_of(effort, *(f.serialize() for f in (step, prepare) if f is not None))
    return _scans.of(key, lambda: Scan(step, prepare, effort, key))


def key_of(*parts: str) -> str:
    """Key of all that a loop depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


class Recent(Generic[Kept]):
    """The loops that were made last, by key."""

    def __init__(self, most: int = 512) -> None:
        self._most = most
        self._kept: dict[str, Kept] = {}

    def of(self, key: str, make: Callable[[], Kept]) -> Kept:
        """The loop with this key, made if there is none."""
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = make()
            while len(self._kept) > self._most:
                self._kept.pop(next(iter(self._kept)))
        return found


_scans: Recent[Scan] = Recent()


def _blocks(lanes: int, width: int) -> Iterator[tuple[int, int]]:
    """First lane and number of lanes of each block; the last is narrow if so many are left."""
    for first in range(0, lanes, width):
        yield first, min(width, lanes - first)


def padded(rows: Array) -> Array:
    """Contiguous copy whose lanes are padded to whole blocks with copies of the last lane."""
    missing = -rows.shape[1] % LANES
    copy = np.empty((rows.shape[0], rows.shape[1] + missing))
    copy[:, : rows.shape[1]] = rows
    if missing:
        copy[:, rows.shape[1] :] = rows[:, -1:]
    return copy


def run(tasks: list[Task]) -> None:
    """Call each kernel with its arguments, the first of which is its number of rows, in threads."""
    if len(tasks) == 1 or threads() == 1:
        for kernel, task in tasks:
            kernel.run(*task)
        return
    # The longest first: one that starts last would leave the other threads idle.
    for _ in _workers(threads()).map(
        lambda each: each[0].run(*each[1]), sorted(tasks, key=lambda each: -each[1][0])
    ):
        pass


@functools.lru_cache(maxsize=1)
def _workers(number: int) -> ThreadPoolExecutor:
    """Threads that call the kernels; ctypes releases the interpreter lock during a call."""
    return ThreadPoolExecutor(number, thread_name_prefix="scan")


os.register_at_fork(after_in_child=_workers.cache_clear)

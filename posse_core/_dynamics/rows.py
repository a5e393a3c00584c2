"""Evaluation of casadi Functions for all rows of numpy arrays.

A Function computes with single columns. :class:`Rows` evaluates it for many rows: it rebuilds the
Function's instructions with vectors in place of scalars, so that each instruction is one tight loop over
a block of rows in casadi's compiled code, through its raw buffers. Arguments that are the same in all
rows stay scalars, and what depends on them alone is computed once per block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray

BLOCK = 1024
"""Rows per block, chosen so that its intermediate vectors stay in the second-level cache."""
_FEW = 16
"""Below this number of rows, evaluating each alone is faster than building a block."""


class Rows:
    """A casadi Function that is called with arrays, whose last axis is the Function's column argument.

    An array for a scalar argument of the Function lacks this last axis. Leading axes broadcast as in
    numpy. The last two axes of a matrix result are the matrix.
    """

    def __init__(self, build: Callable[[], Any]) -> None:
        """build: makes the Function when it is first needed, so that programs that never call it start
        sooner."""
        self._build = build
        self._blocks: dict[tuple[int, tuple[bool, ...]], Any] = {}

    @cached_property
    def function(self) -> Any:
        """The casadi Function."""
        return self._build()

    def __call__(self, *arguments: FloatArray | float) -> Any:
        """Evaluate the Function and return one array per result, in a tuple if there are several."""
        shape, columns = self._broadcast(arguments)
        count = math.prod(shape)
        outs = [np.empty((count, rows * cols)) for rows, cols in self._shapes_out]
        start = 0
        for block in self._evaluate(shape, columns, count):
            stop = start + len(block[0])
            for out, part in zip(outs, block, strict=True):
                out[start:stop] = part
            start = stop
        shaped = tuple(self._shaped(out, k, shape) for k, out in enumerate(outs))
        return shaped if len(shaped) > 1 else shaped[0]

    def stream(self, *arguments: FloatArray | float) -> Iterator[tuple[FloatArray, ...]]:
        """Yield results in blocks of at most :data:`BLOCK` rows, in order of the flattened leading axes.

        The next block overwrites the arrays (rows, elements) of a block, so the caller copies what it
        keeps.
        """
        shape, columns = self._broadcast(arguments)
        yield from self._evaluate(shape, columns, math.prod(shape))

    def _broadcast(
        self, arguments: tuple[FloatArray | float, ...]
    ) -> tuple[tuple[int, ...], list[FloatArray]]:
        sizes = self._sizes_in
        if len(arguments) != len(sizes):
            raise TypeError(f"{self.function.name()} takes {len(sizes)} arguments, not {len(arguments)}")
        columns: list[FloatArray] = []
        for argument, size in zip(arguments, sizes, strict=True):
            array = np.asarray(argument, dtype=np.float64)
            if size == 1:
                array = array[..., None]
            if array.shape[-1:] != (size,):
                name = self.function.name_in(len(columns))
                raise ValueError(f"{name} of {self.function.name()} has {size} elements a row")
            columns.append(array)
        return np.broadcast_shapes(*(c.shape[:-1] for c in columns)), columns

    def _evaluate(
        self, shape: tuple[int, ...], columns: list[FloatArray], count: int
    ) -> Iterator[tuple[FloatArray, ...]]:
        if count == 0:
            return
        size = 1 if count < _FEW else min(BLOCK, 1 << (count - 1).bit_length())
        constant = tuple(column.size == column.shape[-1] for column in columns)
        function = self._block(size, constant)
        inputs = [
            np.empty((c.shape[-1], 1 if k else size)) for c, k in zip(columns, constant, strict=True)
        ]
        results = [np.empty((rows * cols, size)) for rows, cols in self._shapes_out]
        buffer, evaluate = function.buffer()
        for k, array in enumerate(inputs):
            # The unused rows of the last block are computed too, but their results are not read.
            array[:] = columns[k].reshape(-1, len(array))[0][:, None]
            buffer.set_arg(k, array.data)
        for k, array in enumerate(results):
            buffer.set_res(k, array.data)
        varying = [k for k, fixed in enumerate(constant) if not fixed]
        whole = {k: np.broadcast_to(columns[k], (*shape, columns[k].shape[-1])) for k in varying}
        for start in range(0, count, size):
            n = min(size, count - start)
            for k in varying:
                inputs[k][:, :n] = _some_rows(whole[k], shape, start, start + n).T
            evaluate()
            yield tuple(result[:, :n].T for result in results)

    def _block(self, size: int, constant: tuple[bool, ...]) -> Any:
        """The Function over blocks of rows, built once."""
        if size == 1:
            return self.function
        if (size, constant) not in self._blocks:
            self._blocks[size, constant] = _over_rows(self._flat, size, constant)
        return self._blocks[size, constant]

    @cached_property
    def _sizes_in(self) -> list[int]:
        """Elements of each argument."""
        return [self.function.numel_in(k) for k in range(self.function.n_in())]

    @cached_property
    def _shapes_out(self) -> list[tuple[int, int]]:
        """Rows and columns of each result."""
        return [self.function.size_out(k) for k in range(self.function.n_out())]

    @cached_property
    def _flat(self) -> Any:
        """The Function as a list of scalar instructions."""
        return self.function if self.function.is_a("SXFunction") else self.function.expand()

    def _shaped(self, out: FloatArray, k: int, shape: tuple[int, ...]) -> FloatArray:
        rows, cols = self._shapes_out[k]
        if rows == cols == 1:
            return out.reshape(shape)
        if cols == 1:
            return out.reshape(*shape, rows)
        return np.swapaxes(out.reshape(*shape, cols, rows), -1, -2)


def _over_rows(f: Any, size: int, constant: tuple[bool, ...]) -> Any:
    """The scalar Function ``f`` on vectors of ``size`` rows: arguments and results (rows, elements)."""
    arguments = [
        ca.MX.sym(f.name_in(k), 1 if fixed else size, f.numel_in(k)) for k, fixed in enumerate(constant)
    ]
    inputs = [ca.horzsplit(argument) for argument in arguments]
    results: list[list[Any]] = [[None] * f.numel_out(k) for k in range(f.n_out())]
    work: dict[int, Any] = {}
    for k in range(f.n_instructions()):
        code, taken, given = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if code == ca.OP_INPUT:
            work[given[0]] = inputs[taken[0]][taken[1]]
        elif code == ca.OP_OUTPUT:
            # A result that is the same for all rows is repeated for each.
            results[given[0]][given[1]] = work[taken[0]] + ca.DM.zeros(size)
        elif code == ca.OP_CONST:
            work[given[0]] = ca.MX(f.instruction_constant(k))
        elif len(taken) == 1:
            work[given[0]] = ca.MX.unary(code, work[taken[0]])
        else:
            work[given[0]] = ca.MX.binary(code, work[taken[0]], work[taken[1]])
    return ca.Function(f.name(), arguments, [ca.horzcat(*columns) for columns in results])


def _some_rows(whole: FloatArray, shape: tuple[int, ...], start: int, stop: int) -> FloatArray:
    """Rows start…stop of (*shape, n), flattened to (rows, n), without flattening all of it."""
    if whole.flags.c_contiguous:
        return whole.reshape(-1, whole.shape[-1])[start:stop]
    return np.asarray(whole[np.unravel_index(np.arange(start, stop), shape)])


def dense(name: str, arguments: dict[str, Any], results: dict[str, Any]) -> Any:
    """A casadi Function with named arguments and results, all dense, as raw buffers need them."""
    return ca.Function(
        name,
        list(arguments.values()),
        [ca.densify(result) for result in results.values()],
        list(arguments),
        list(results),
    )

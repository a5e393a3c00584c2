"""casadi Functions over whole numpy arrays.

A Function takes and gives single columns. :class:`Rows` maps it over the rows of arrays, in blocks of
fixed size through casadi's raw buffers: no conversion to casadi's own matrices, and no memory that
grows with the count beyond the result itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from posse_core.model.arrays import FloatArray

BLOCK = 2048
"""Rows a block: the block's arguments and results stay in the second-level cache."""


class Rows:
    """A casadi Function, called with arrays whose last axis is the Function's column.

    A scalar argument of the Function (one row, one column) is given as an array without the last
    axis. Leading axes broadcast as in numpy. A matrix result has its two axes last.
    """

    def __init__(self, function: Any) -> None:
        self.function = function

    def __call__(self, *arguments: FloatArray | float) -> Any:
        """One array a result of the Function; the array itself where there is one result."""
        shape, columns = self._broadcast(arguments)
        count = int(np.prod(shape))
        f = self.function
        outs = [np.empty((count, f.numel_out(k))) for k in range(f.n_out())]
        start = 0
        for block in self._evaluate(shape, columns, count):
            stop = start + len(block[0])
            for out, part in zip(outs, block, strict=True):
                out[start:stop] = part
            start = stop
        shaped = tuple(self._shaped(out, k, shape) for k, out in enumerate(outs))
        return shaped if len(shaped) > 1 else shaped[0]

    def stream(self, *arguments: FloatArray | float) -> Iterator[tuple[FloatArray, ...]]:
        """Results in blocks of at most :data:`BLOCK` rows, in order of the flattened leading axes.

        The arrays of a block (rows, elements) are overwritten by the next one: copy what is kept.
        """
        shape, columns = self._broadcast(arguments)
        yield from self._evaluate(shape, columns, int(np.prod(shape)))

    def _broadcast(
        self, arguments: tuple[FloatArray | float, ...]
    ) -> tuple[tuple[int, ...], list[FloatArray]]:
        f = self.function
        if len(arguments) != f.n_in():
            raise TypeError(f"{f.name()} takes {f.n_in()} arguments, not {len(arguments)}")
        columns: list[FloatArray] = []
        for k, argument in enumerate(arguments):
            array = np.asarray(argument, dtype=np.float64)
            size = f.numel_in(k)
            if size == 1:
                array = array[..., None]
            if array.shape[-1:] != (size,):
                raise ValueError(f"{f.name_in(k)} of {f.name()} has {size} elements a row")
            columns.append(array)
        return np.broadcast_shapes(*(c.shape[:-1] for c in columns)), columns

    def _evaluate(
        self, shape: tuple[int, ...], columns: list[FloatArray], count: int
    ) -> Iterator[tuple[FloatArray, ...]]:
        if count == 0:
            return
        size = min(BLOCK, 1 << (count - 1).bit_length())
        inputs, results, evaluate, _alive = self._block(size)
        whole = [np.broadcast_to(column, (*shape, column.shape[-1])) for column in columns]
        for buffer, column in zip(inputs, columns, strict=True):
            # The last block's spare rows compute something that nobody reads.
            buffer[:] = column.reshape(-1, column.shape[-1])[0]
        varying = [k for k, column in enumerate(columns) if column.size > column.shape[-1]]
        for start in range(0, count, size):
            n = min(size, count - start)
            for k in varying:
                inputs[k][:n] = _some_rows(whole[k], shape, start, start + n)
            evaluate()
            yield tuple(result[:n] for result in results)

    def _block(self, size: int) -> tuple[list[FloatArray], list[FloatArray], Any, Any]:
        """Arguments and results of a block, what computes the ones from the others, and its owner,
        which must outlive it: casadi's evaluator holds no reference of its own."""
        f = self.function
        mapped = f if size == 1 else f.map(size)
        inputs = [np.empty((size, f.numel_in(k))) for k in range(f.n_in())]
        results = [np.empty((size, f.numel_out(k))) for k in range(f.n_out())]
        buffer, evaluate = mapped.buffer()
        for k, array in enumerate(inputs):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(results):
            buffer.set_res(k, array.data)
        return inputs, results, evaluate, (mapped, buffer)

    def _shaped(self, out: FloatArray, k: int, shape: tuple[int, ...]) -> FloatArray:
        rows, cols = self.function.size_out(k)
        if rows == cols == 1:
            return out.reshape(shape)
        if cols == 1:
            return out.reshape(*shape, rows)
        return np.swapaxes(out.reshape(*shape, cols, rows), -1, -2)


def _some_rows(whole: FloatArray, shape: tuple[int, ...], start: int, stop: int) -> FloatArray:
    """Rows start…stop of (*shape, n), flattened to (rows, n), without flattening all of it."""
    if whole.flags.c_contiguous:
        return whole.reshape(-1, whole.shape[-1])[start:stop]
    return np.asarray(whole[np.unravel_index(np.arange(start, stop), shape)])


def dense(name: str, arguments: dict[str, Any], results: dict[str, Any], **options: Any) -> Any:
    """A casadi Function with named arguments and results, all dense, as raw buffers need them."""
    return ca.Function(
        name,
        list(arguments.values()),
        [ca.densify(result) for result in results.values()],
        list(arguments),
        list(results),
        options,
    )

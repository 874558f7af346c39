"""Kernels: recorded formulas, compiled, that take arrays and return arrays."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.kernel.compiled import MachineCode
from model.kernel.elementary import Precision
from model.kernel.expression import Graph, Symbol, Value
from model.kernel.llvm_text import LANES, assembly
from model.kernel.lowering import lowered

# Fewer directions than this are done before a second thread has started.
_WORTH_A_THREAD = 8192

Formula = Callable[[Mapping[str, Symbol]], Sequence[Value]]


class Kernel:
    """A formula, compiled.

    Every direction is computed by the same operations, wherever in an array and among however many it stands.

    Parameters
    ----------
    formula : callable
        From symbols of the inputs by name to the outputs.
    inputs : sequence of str
        Names of the inputs, in the order in which calls give them.
    uniform : frozenset of str
        Inputs that calls give as one number for all directions: what depends on them alone is computed once.
    precision : Precision
        Of inputs and outputs.
    """

    def __init__(self, formula: Formula, inputs: Sequence[str], uniform: frozenset[str], precision: Precision) -> None:
        graph = Graph()
        outputs = lowered(formula({name: graph.input(name) for name in inputs}), precision)
        self._rows = len(outputs)
        self._numbers = {row: output for row, output in enumerate(outputs) if not isinstance(output, Symbol)}
        self._inputs = [(name, name in uniform) for name in inputs]
        self._dtype = np.dtype(precision)
        self._lanes = LANES[precision]
        computed = {row: output for row, output in enumerate(outputs) if isinstance(output, Symbol)}
        self._code = MachineCode(assembly(inputs, uniform, computed, precision)) if computed else None

    def __call__(self, arrays: Sequence[NDArray[np.floating]], count: int) -> NDArray[np.floating]:
        """Outputs (outputs, count) from one array a non-uniform input (count,) and one number a uniform one."""
        rows: NDArray[np.floating] = self.repeated([array.reshape(1, -1) for array in arrays], 1, count)[0]
        return rows

    def repeated(self, arrays: Sequence[NDArray[np.floating]], times: int, count: int) -> NDArray[np.floating]:
        """Outputs (times, outputs, count) for many sets of inputs.

        Each array has the shape (times, count) or (times, 1), or with 1 in place of `times` what all sets share.
        """
        width = max(count, self._lanes)
        taken = [self._taken(array, uniform, width) for (_, uniform), array in zip(self._inputs, arrays, strict=True)]
        outputs = np.empty((times, self._rows, width), self._dtype)
        for row, number in self._numbers.items():
            outputs[:, row] = number
        if self._code is not None and count and times:
            self._run(taken, outputs)
        return outputs[..., :count]

    def _taken(self, array: NDArray[np.floating], uniform: bool, width: int) -> NDArray[np.floating]:
        values = np.ascontiguousarray(array, self._dtype)
        short = values.shape[1] < width and not uniform
        if short:
            values = values[:, np.arange(width) % values.shape[1]] if values.size else np.zeros((1, width), self._dtype)
        return values

    def _run(self, arrays: Sequence[NDArray[np.floating]], outputs: NDArray[np.floating]) -> None:
        times, _, width = outputs.shape
        parts = min(_cores(), times * width // _WORTH_A_THREAD) or 1
        # One set is shared out by its directions, many are as wholes.
        whole, grain = (times, 1) if times > 1 else (width, self._lanes)
        edges = [whole * part // parts // grain * grain for part in range(parts)] + [whole]
        spans = [span for span in pairwise(edges) if span[0] < span[1]]
        try:
            waiting = [_threads().submit(self._part, arrays, outputs, *span) for span in spans[1:]]
        except RuntimeError:  # the interpreter is ending and starts no thread any more
            waiting, spans = [], [(0, whole)]
        self._part(arrays, outputs, *spans[0])
        for thread in waiting:
            thread.result()

    def _part(
        self, arrays: Sequence[NDArray[np.floating]], outputs: NDArray[np.floating], start: int, stop: int
    ) -> None:
        size, (times, _, width) = self._dtype.itemsize, outputs.shape
        one = times == 1
        count, repeats = (stop - start, 1) if one else (width, stop - start)
        offsets = np.array([0 if one and uniform else start for _, uniform in self._inputs], np.int64)
        steps = np.array([0 if len(array) == 1 else array.strides[0] for array in arrays], np.int64)
        pointers = np.array([_address(array) for array in arrays], np.int64) + offsets * (size if one else steps)
        moving = np.empty_like(pointers)
        first = _address(outputs) + start * (size if one else outputs.strides[0])
        assert self._code is not None
        self._code.call(repeats, *map(_address, (pointers, steps, moving)), first, outputs.strides[0], count, width)


def _address(array: NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]  # several times faster than array.ctypes
    return address


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_cores(), thread_name_prefix="kernel")


if hasattr(os, "register_at_fork"):
    # A forked process has this one's memory, but none of its threads.
    os.register_at_fork(after_in_child=_threads.cache_clear)

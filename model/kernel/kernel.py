"""Kernels: recorded formulas, compiled, that take arrays and return arrays."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.kernel.compiled import MachineCode
from model.kernel.elementary import Precision
from model.kernel.expression import Graph, Symbol, Value
from model.kernel.llvm_text import LANES, VECTOR_BYTES, assembly
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
    counts : frozenset of str, optional
        Inputs that are whole numbers of 16 bits instead, as cameras give them; none of them uniform.
    """

    def __init__(
        self,
        formula: Formula,
        inputs: Sequence[str],
        uniform: frozenset[str],
        precision: Precision,
        counts: frozenset[str] = frozenset(),
    ) -> None:
        self._dtype = np.dtype(precision)
        self._inputs = [(np.dtype(np.uint16) if name in counts else self._dtype, name in uniform) for name in inputs]
        self._lanes = LANES[precision]
        # A graph is large, and not needed once there is code: whoever wants other code records it again.
        self._record = partial(_recorded, formula, inputs, precision)
        self._assembly = partial(assembly, inputs, uniform, precision=precision, counts=counts)
        outputs = self._record()
        self._rows = len(outputs)
        self._numbers = {row: output for row, output in enumerate(outputs) if not isinstance(output, Symbol)}
        self._code = MachineCode(self._assembly(_computed(outputs))) if _computed(outputs) else None

    def __call__(self, arrays: Sequence[NDArray[np.floating]], count: int) -> NDArray[np.floating]:
        """Outputs (outputs, count) from one array a non-uniform input (count,) and one number a uniform one."""
        rows: NDArray[np.floating] = self.repeated([array.reshape(1, -1) for array in arrays], 1, count)[0]
        return rows

    def repeated(self, arrays: Sequence[NDArray[np.floating]], times: int, count: int) -> NDArray[np.floating]:
        """Outputs (times, outputs, count) for many sets of inputs.

        Each array has the shape (times, count) or (times, 1), or with 1 in place of `times` what all sets share.
        """
        width = max(count, self._lanes)
        taken = [_taken(array, *kind, width) for kind, array in zip(self._inputs, arrays, strict=True)]
        outputs = np.empty((times, self._rows, width), self._dtype)
        for row, number in self._numbers.items():
            outputs[:, row] = number
        if self._code is not None and count and times:
            self._run(taken, outputs)
        return outputs[..., :count]

    def write(self, arrays: Sequence[NDArray[Any]], outputs: NDArray[np.floating], *, past_cache: bool) -> None:
        """Outputs into memory that is there.

        Parameters
        ----------
        arrays : sequence of ndarray
            As in a call.
        outputs : ndarray
            (outputs, count) of the kernel's precision, each row in one piece.
        past_cache : bool
            Whether they go straight to memory, which takes two thirds of the time where they are more than the cache
            holds; whoever needs them at once does better without.
        """
        count = outputs.shape[1]
        if count < self._lanes:
            outputs[:] = self(arrays, count)
            return
        taken = [_taken(array.reshape(1, -1), *kind, count) for kind, array in zip(self._inputs, arrays, strict=True)]
        for row, number in self._numbers.items():
            outputs[row] = number
        if self._code is not None:
            self._run(taken, outputs[np.newaxis], past_cache)

    @cached_property
    def _code_past_cache(self) -> MachineCode:
        return MachineCode(self._assembly(_computed(self._record()), past_cache=True))

    def _run(
        self, arrays: Sequence[NDArray[np.floating]], outputs: NDArray[np.floating], past_cache: bool = False
    ) -> None:
        times, _, width = outputs.shape
        part = self._part_past_cache if past_cache else self._part
        parts = min(_cores(), times * width // _WORTH_A_THREAD) or 1
        # One set is shared out by its directions, many are as wholes.
        whole, grain = (times, 1) if times > 1 else (width, self._lanes)
        edges = [whole * number // parts // grain * grain for number in range(parts)] + [whole]
        spans = [span for span in pairwise(edges) if span[0] < span[1]]
        try:
            waiting = [_threads().submit(part, arrays, outputs, *span) for span in spans[1:]]
        except RuntimeError:  # the interpreter is ending and starts no thread any more
            waiting, spans = [], [(0, whole)]
        part(arrays, outputs, *spans[0])
        for thread in waiting:
            thread.result()

    def _part_past_cache(
        self, arrays: Sequence[NDArray[np.floating]], outputs: NDArray[np.floating], start: int, stop: int
    ) -> None:
        first = start + -(_address(outputs) // outputs.itemsize + start) % self._lanes
        last = first + (stop - first) // self._lanes * self._lanes
        if outputs.strides[1] % VECTOR_BYTES or first == last:  # rows begin at different places between the steps
            self._part(arrays, outputs, start, stop)
            return
        # The ends overlap the rest, so as to be of whole steps.
        if first > start:
            self._part(arrays, outputs, start, start + self._lanes)
        self._part(arrays, outputs, first, last, self._code_past_cache)
        if last < stop:
            self._part(arrays, outputs, stop - self._lanes, stop)

    def _part(
        self,
        arrays: Sequence[NDArray[np.floating]],
        outputs: NDArray[np.floating],
        start: int,
        stop: int,
        code: MachineCode | None = None,
    ) -> None:
        times, _, width = outputs.shape
        one = times == 1
        count, repeats = (stop - start, 1) if one else (width, stop - start)
        offsets = np.array([0 if one and uniform else start for _, uniform in self._inputs], np.int64)
        steps = np.array([0 if len(array) == 1 else array.strides[0] for array in arrays], np.int64)
        sizes = np.array([array.itemsize for array in arrays], np.int64)
        pointers = np.array([_address(array) for array in arrays], np.int64) + offsets * (sizes if one else steps)
        moving = np.empty_like(pointers)
        first = _address(outputs) + start * (outputs.itemsize if one else outputs.strides[0])
        code = code or self._code
        assert code is not None
        stride = outputs.strides[1] // outputs.itemsize
        code.call(repeats, *map(_address, (pointers, steps, moving)), first, outputs.strides[0], count, stride)


def _recorded(formula: Formula, inputs: Sequence[str], precision: Precision) -> Sequence[Value]:
    graph = Graph()
    return lowered(formula({name: graph.input(name) for name in inputs}), precision)


def _computed(outputs: Sequence[Value]) -> dict[int, Symbol]:
    return {row: output for row, output in enumerate(outputs) if isinstance(output, Symbol)}


def _taken(array: NDArray[Any], dtype: np.dtype[Any], uniform: bool, width: int) -> NDArray[Any]:
    values = np.ascontiguousarray(array, dtype)
    if values.shape[1] < width and not uniform:
        # Unlike an index, `take` leaves each set in one piece.
        return values.take(np.arange(width) % values.shape[1], axis=1) if values.size else np.zeros((1, width), dtype)
    return values


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

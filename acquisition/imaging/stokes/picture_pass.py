"""A formula of pixels, compiled, and passed over pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import ReductionError
from model.kernel.kernel import Formula, Kernel

Map = NDArray[np.float32]

_BAND_PIXELS = 1 << 18
"""So many pixels at a time stay in the processor's cache until they are used."""


class PicturePass:
    """Makes maps of pictures of one size, all in one pass.

    Parameters
    ----------
    formula : callable
        From symbols of a pixel's values, and of what is the same for all pixels, to the outputs.
    pictures : sequence of str
        Names of the pictures, in the order in which they are given.
    uniform : mapping of str to float
        What is the same for all pixels.
    outputs : tuple of str
        Names of the maps.
    counts : frozenset of str, optional
        The pictures that are of uint16 rather than float32.
    """

    def __init__(
        self,
        formula: Formula,
        pictures: Sequence[str],
        uniform: Mapping[str, float],
        outputs: tuple[str, ...],
        counts: frozenset[str] = frozenset(),
    ) -> None:
        self._outputs = outputs
        self._uniform = [np.array([value], np.float32) for value in uniform.values()]
        self._kernel = Kernel(formula, [*pictures, *uniform], frozenset(uniform), "float32", counts)

    def maps(self, pictures: Sequence[NDArray[Any]], out: Map | None = None) -> dict[str, Map]:
        """All maps by name, each (height, width): of `out`, if it is given, or of memory of their own.

        Raises
        ------
        ReductionError
            When `out` is not (outputs, height, width) of float32 in one piece.
        """
        shape = (len(self._outputs), *pictures[0].shape)
        if out is None:
            out = np.empty(shape, np.float32)
        if out.shape != shape or out.dtype != np.float32 or not out.flags.c_contiguous or not out.flags.writeable:
            raise ReductionError(
                f"The maps were to be written into an array {out.shape} of {out.dtype}; needed is one {shape} of "
                "float32, in one piece and writeable. Nothing was written."
            )
        in_one_piece = all(picture.flags.c_contiguous for picture in pictures)
        for rows in [slice(0, shape[1])] if in_one_piece else _bands(*shape[1:]):
            self._kernel.write(self._inputs(pictures, rows), out[:, rows].reshape(len(out), -1), past_cache=True)
        return dict(zip(self._outputs, out, strict=True))

    def bands(self, pictures: Sequence[NDArray[Any]]) -> Iterator[tuple[slice, Map]]:
        """The same, some rows at a time: which, and all maps of them, (outputs, rows, width).

        Whoever writes them into a file needs no memory for the whole. A band is overwritten by the next one.
        """
        height, width = pictures[0].shape
        memory = np.empty(len(self._outputs) * (max(_BAND_PIXELS // width, 1)) * width, np.float32)
        for rows in _bands(height, width):
            shape = len(self._outputs), rows.stop - rows.start, width
            band = memory[: np.prod(shape)].reshape(shape)
            self._kernel.write(self._inputs(pictures, rows), band.reshape(len(band), -1), past_cache=False)
            yield rows, band

    def _inputs(self, pictures: Sequence[NDArray[Any]], rows: slice) -> list[NDArray[Any]]:
        return [*(picture[rows].reshape(-1) for picture in pictures), *self._uniform]


def _bands(height: int, width: int) -> list[slice]:
    edges = [*range(0, height, max(_BAND_PIXELS // width, 1)), height]
    return [slice(*rows) for rows in pairwise(edges)]

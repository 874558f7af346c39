"""Stokes parameters of every pixel of a stack of frames, in one compiled pass over it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.stokes.picture_pass import Map, PicturePass
from acquisition.imaging.stokes.pixel_formula import PixelFormula
from goniometer.errors import ReductionError


class StokesImages:
    """Reduces stacks of frames, one behind each analyzer state.

    Parameters
    ----------
    formula : PixelFormula
        What is asked, and what a pixel goes through.
    dark, flat : ndarray, optional
        (height, width): counts of a dark frame of the same exposure, and relative sensitivity with mean 1; given where
        the formula has them.
    """

    def __init__(self, formula: PixelFormula, *, dark: Map | None = None, flat: Map | None = None) -> None:
        given = {"dark": dark, "flat": flat}
        self._maps = [np.ascontiguousarray(given[name], np.float32) for name in formula.maps()]
        self._frames = len(formula.counts())
        pictures = [*formula.counts(), *formula.maps()]
        self._pass = PicturePass(
            formula.record, pictures, formula.weights(), formula.outputs, frozenset(formula.counts())
        )

    def maps(self, stack: NDArray[np.uint16], out: Map | None = None) -> dict[str, Map]:
        """All that is asked, by name, each (height, width).

        Parameters
        ----------
        stack : ndarray
            (N, height, width), 16-bit counts; a frame behind each of the formula's N states, in their order.
        out : ndarray, optional
            (outputs, height, width) of float32, in one piece, to be written into; the maps are then parts of it. New
            memory costs more than what is written into it: give the same again for every stack of a camera.

        Raises
        ------
        ReductionError
            When the stack's shape or type is another one, or that of `out`.
        """
        self._check(stack)
        return self._pass.maps([*stack, *self._maps], out)

    def bands(self, stack: NDArray[np.uint16]) -> Iterator[tuple[slice, Map]]:
        """The same, some rows at a time: which, and all that is asked of them, (outputs, rows, width).

        Whoever writes them into a file needs no memory for the whole. A band is overwritten by the next one.
        """
        self._check(stack)
        return self._pass.bands([*stack, *self._maps])

    def _check(self, stack: NDArray[Any]) -> None:
        wanted = {image.shape for image in self._maps} or {stack.shape[1:]}
        is_right = stack.ndim == 3 and len(stack) == self._frames and stack.size > 0 and stack.dtype == np.uint16
        if not is_right or stack.shape[1:] not in wanted:
            sizes = " or ".join("x".join(map(str, size)) for size in wanted if len(size) == 2)
            raise ReductionError(
                f"The frames are an array {stack.shape} of {stack.dtype}; needed are {self._frames} frames"
                f"{f' of {sizes}' if sizes else ''} in 16-bit counts of this machine's byte order, uint16, one behind "
                "each state of the analyzer. Nothing was made of them."
            )

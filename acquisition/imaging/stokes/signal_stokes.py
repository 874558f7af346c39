"""Stokes parameters of every pixel of corrected pictures, each of which knows its own errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.stokes.picture_pass import Map, PicturePass
from acquisition.imaging.stokes.pixel_values import PixelValues, check_outputs, needs_variances, weights_of
from goniometer.errors import ReductionError
from model.kernel.expression import Symbol, Value


class SignalStokes:
    """Reduces sets of pictures, one behind each analyzer state.

    Where any of them has NaN, for nothing is known, all that is asked is NaN.

    Parameters
    ----------
    inverse : ndarray
        (3 or 4, N): Stokes parameters from the light behind N analyzer states, in their order (`inverse_of`). It is
        one for all pixels: a pixel's own errors do not weigh its states.
    outputs : tuple of str
        What is asked: `S0` to `S3`, `DoLP` and `AoLP_rad`, each also with `_variance`; `S0_S1_covariance` and those of
        other pairs.

    Raises
    ------
    ReductionError
        When an output is not among these.
    """

    def __init__(self, inverse: NDArray[np.float64], outputs: tuple[str, ...]) -> None:
        check_outputs(inverse, outputs)
        self._inverse, self._outputs = inverse, outputs
        self._signals = [f"signal{state}" for state in range(inverse.shape[1])]
        # What nobody asks is not read either.
        self._variances = [f"variance{state}" for state in range(inverse.shape[1]) if needs_variances(outputs)]
        self._pass = PicturePass(self._record, [*self._signals, *self._variances], weights_of(inverse), outputs)

    def maps(self, signals: Sequence[SignalImage], out: Map | None = None) -> dict[str, Map]:
        """All that is asked, by name, each (height, width); Stokes parameters in the signals' unit.

        Parameters
        ----------
        signals : sequence of SignalImage
            One behind each of the N states, in their order.
        out : ndarray, optional
            (outputs, height, width) of float32, in one piece, to be written into; the maps are then parts of it. New
            memory costs more than what is written into it: give the same again for every set of pictures.

        Raises
        ------
        ReductionError
            When they are not N, or of different sizes, or not of float32; or when `out` has another shape or type.
        """
        return self._pass.maps(self._pictures(signals), out)

    def bands(self, signals: Sequence[SignalImage]) -> Iterator[tuple[slice, Map]]:
        """The same, some rows at a time: which, and all that is asked of them, (outputs, rows, width).

        Whoever writes them into a file needs no memory for the whole. A band is overwritten by the next one.
        """
        return self._pass.bands(self._pictures(signals))

    def _pictures(self, signals: Sequence[SignalImage]) -> list[NDArray[Any]]:
        pictures = [image.signal for image in signals]
        if self._variances:
            pictures += [image.variance for image in signals]
        kinds = {(picture.shape, str(picture.dtype)) for picture in pictures}
        is_right = len(signals) == len(self._signals) and len(kinds) == 1
        if not is_right or pictures[0].dtype != np.float32 or pictures[0].ndim != 2 or not pictures[0].size:
            found = " and ".join(f"{shape} of {dtype}" for shape, dtype in sorted(kinds)) or "nothing"
            raise ReductionError(
                f"The signals are {len(signals)} pictures with arrays {found}; needed are {len(self._signals)} of one "
                "size in float32, one behind each state of the analyzer. Nothing was made of them."
            )
        return pictures

    def _record(self, at: Mapping[str, Symbol]) -> list[Value]:
        signals, variances = ([at[name] for name in names] for names in (self._signals, self._variances))
        found = PixelValues(self._inverse, at, signals, variances)
        return [found.value(name) for name in self._outputs]

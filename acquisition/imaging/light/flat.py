"""How sensitive each pixel is beside the others, from pictures of something evenly bright."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.signal_image import SignalImage
from drivers.camera.quiet_opencv import quiet_opencv
from drivers.camera.region import Region
from goniometer.errors import ReductionError

Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Flat:
    """Relative sensitivity of every pixel; the lens' vignetting is among it.

    Parameters
    ----------
    sensitivity : ndarray
        (height, width) of float32, its mean 1 over good pixels; NaN of bad ones.
    relative_variance : ndarray
        (height, width) of float32: variance of `sensitivity` over its square.
    """

    sensitivity: Map
    relative_variance: Map

    @classmethod
    def of(cls, even: SignalImage, *, dimmest: float = 0.2, brightest: float = 3.0) -> Flat:
        """Sensitivity from the signal of something evenly bright, freed of dark but not yet of sensitivity.

        Parameters
        ----------
        even : SignalImage
            Made of as many frames as can be had: its errors are those of all that is divided by it.
        dimmest, brightest : float
            Limits of the sensitivity relative to the median; pixels outside are bad.

        Raises
        ------
        ReductionError
            When there is no light in it.
        """
        typical = float(np.nanmedian(even.signal)) if np.isfinite(even.signal).any() else 0.0
        if not typical > 0.0:
            raise ReductionError(
                f"The flat frames' median is {typical:g} counts/s above dark: there is no light in them, or all is "
                "saturated. No sensitivity was made. Look at the lamp and the exposure, and take them again."
            )
        is_good = (even.signal >= dimmest * typical) & (even.signal <= brightest * typical)
        signal: Map = np.where(is_good, even.signal, np.float32(np.nan)).astype(np.float32)
        relative_variance: Map = even.variance / (signal * signal)
        signal /= np.float32(np.mean(signal, where=is_good, dtype=np.float64))
        return cls(signal, relative_variance)

    def beside(self, region: Region) -> Flat:
        """The same with the mean 1 over a region, which is then as bright as without a flat.

        Raises
        ------
        ReductionError
            When all of the region's pixels are bad.
        """
        within = self.sensitivity[region.top : region.top + region.height, region.left : region.left + region.width]
        if not np.isfinite(within).any():
            raise ReductionError(
                "The flat knows nothing of the region that the rig names: all of its pixels are bad there. It was not "
                "used. Choose another region, or make the flat again."
            )
        return Flat(self.sensitivity / np.float32(np.nanmean(within, dtype=np.float64)), self.relative_variance)

    @property
    def is_bad(self) -> NDArray[np.bool_]:
        """Which pixels the flat knows nothing of: dead, dim, far too bright, or saturated."""
        return np.isnan(self.sensitivity)

    @property
    def spread(self) -> float:
        """Standard deviation of the good pixels' sensitivities, over their mean."""
        return float(np.nanstd(self.sensitivity))

    @property
    def typical_stderr(self) -> float:
        """Median standard error of a pixel's sensitivity, over it."""
        return float(np.sqrt(np.nanmedian(self.relative_variance)))

    def save(self, path: Path) -> None:
        """Write a TIFF of two pages of 32-bit floats: sensitivity, then its relative variance."""
        import cv2

        done, content = cv2.imencodemulti(".tiff", [self.sensitivity, self.relative_variance])
        assert done, "floats always make a TIFF"
        path.write_bytes(content.tobytes())

    @classmethod
    def load(cls, path: Path) -> Flat:
        """Read what `save` wrote.

        Raises
        ------
        ReductionError
            When the file holds something else.
        OSError
            When it cannot be read.
        """
        import cv2

        content = np.frombuffer(path.read_bytes(), np.uint8)
        quiet_opencv()
        is_tiff = content[:2].tobytes() in (b"II", b"MM")
        try:
            pages = cv2.imdecodemulti(content, cv2.IMREAD_UNCHANGED)[1] if is_tiff else ()
        except cv2.error:
            pages = ()
        if len(pages) != 2 or any(page.dtype != np.float32 or page.shape != pages[0].shape for page in pages):
            raise ReductionError(
                f"{path} is no flat: it must be a TIFF of two pages of 32-bit floats of one size, sensitivity and its "
                "relative variance. It was not used. Make it again from flat frames."
            )
        sensitivity, relative_variance = (np.asarray(page, np.float32) for page in pages)
        is_good = ~np.isnan(sensitivity)
        mean = float(np.mean(sensitivity, where=is_good, dtype=np.float64)) if is_good.any() else 0.0
        relative = relative_variance[is_good]
        is_possible = (sensitivity[is_good] > 0.0).all() and (np.isfinite(relative) & (relative >= 0.0)).all()
        if not (abs(mean - 1.0) <= 1e-3 and is_possible):
            raise ReductionError(
                f"{path} is no flat: sensitivities are above 0 and have the mean 1 over good pixels, here {mean:.4g}, "
                "their variances are 0 or more, and pixels that are not good are NaN. It was not used. Make it again "
                "from flat frames."
            )
        return cls(sensitivity, relative_variance)

"""What is reduced, to what, and by us: frames behind four polarizers, and maps of what is asked of every pixel."""

from __future__ import annotations

import sys
from itertools import combinations
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.stokes.picture_pass import PicturePass
from acquisition.imaging.stokes.pixel_formula import PixelFormula, SensorNoise
from acquisition.imaging.stokes.signal_stokes import SignalStokes
from acquisition.imaging.stokes.stokes_image import StokesImages
from acquisition.imaging.stokes.stokes_inverse import inverse_of
from model.kernel.expression import Symbol, Value, maximum

HEIGHT, WIDTH = 2048, 2448
PIXELS = HEIGHT * WIDTH
ANGLES_DEG = (0.4, 45.7, 89.8, 134.5)  # as found by a calibration: no two rows of the inverse are alike
INVERSE = inverse_of([AnalyzerState(angle_deg) for angle_deg in ANGLES_DEG])
NOISE = SensorNoise(read_counts=2.5, electrons_per_count=3.1)

STOKES = ("S0", "S1", "S2")
FUSED = (*STOKES, *(f"{name}_variance" for name in STOKES), "DoLP", "AoLP_rad")
EVERYTHING = (
    *FUSED,
    "DoLP_variance",
    "AoLP_rad_variance",
    *(f"{one}_{other}_covariance" for one, other in combinations(STOKES, 2)),
)


def frames() -> NDArray[np.uint16]:
    """Counts of light that is polarized by 5 to 90 %, in every direction."""
    random = np.random.default_rng(11)
    s0, degree, angle = (random.uniform(*span, (HEIGHT, WIDTH)) for span in ((4e3, 5e4), (0.05, 0.9), (0.0, np.pi)))
    stack = np.empty((len(ANGLES_DEG), HEIGHT, WIDTH), np.uint16)
    for image, polarizer_rad in zip(stack, np.radians(ANGLES_DEG), strict=True):
        image[:] = np.rint(0.5 * s0 * (1.0 + degree * np.cos(2.0 * (angle - polarizer_rad))))
    return stack


def signals(stack: NDArray[np.uint16]) -> list[SignalImage]:
    """The same as corrected pictures, in float32, each with its variance."""
    variances = (stack / np.float32(NOISE.electrons_per_count) + np.float32(NOISE.read_counts**2)).astype(np.float32)
    return [SignalImage(image.astype(np.float32), variance) for image, variance in zip(stack, variances, strict=True)]


def of_counts(outputs: tuple[str, ...]) -> StokesImages:
    """Our reduction of frames."""
    return StokesImages(PixelFormula(INVERSE, outputs, noise=NOISE))


def of_signals(outputs: tuple[str, ...]) -> SignalStokes:
    """Our reduction of signals."""
    return SignalStokes(INVERSE, outputs)


def limit(maps: int, counts: int = 4, floats: int = 0) -> PicturePass:
    """Reads so many pictures, writes so many maps, and computes nothing but a maximum, so as to read all."""
    names = [f"picture{place}" for place in range(counts + floats)]

    def formula(at: dict[str, Symbol]) -> list[Value]:
        read = [at[name] for name in names]
        if maps < len(read):
            read = [*read[: maps - 1], maximum(*read[maps - 1 :])]
        return [read[place % len(read)] for place in range(maps)]

    return PicturePass(formula, names, {}, tuple(map(str, range(maps))), frozenset(names[:counts]))

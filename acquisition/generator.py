"""The light on the sample behind a polarization state generator: a polarizer, and perhaps a retarder behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import AnalyzerState

_SAME = 1e-8
"""A Stokes parameter up to which light is taken to have none of it."""


@dataclass(frozen=True)
class GeneratorState:
    """What the light has passed before the sample; angles in degrees from the s-direction, towards p.

    Parameters
    ----------
    polarizer_deg : float or None
        Angle of the transmitted polarization; None where there is no generator, and the light is unpolarized.
    retarder_deg : float or None
        Angle of the fast axis of the retarder that the light passes behind the polarizer; None without one.
    retardance_deg : float or None
        By how much the slow axis comes behind the fast one; None without a retarder.
    """

    polarizer_deg: float | None = None
    retarder_deg: float | None = None
    retardance_deg: float | None = None

    @classmethod
    def of(cls, named: AnalyzerState) -> Self:
        """The generator with the angles and the retardance of an analyzer."""
        return cls(named.polarizer_deg, named.retarder_deg, named.retardance_deg)

    def column(self) -> NDArray[np.float64]:
        """Stokes parameters (4,) of the light on the sample, with S0 = 1.

        For a polarizer at psi before a retarder delta at beta, with u = 2 psi - 2 beta, they are [1, cos u cos 2beta -
        cos delta sin u sin 2beta, cos u sin 2beta + cos delta sin u cos 2beta, -sin delta sin u].
        """
        row = self.reversed.row()
        return np.asarray(row / row[0])

    @property
    def reversed(self) -> AnalyzerState:
        """The analyzer that passes of all light most of what this generator makes: a retarder undoes what it did."""
        retardance_deg = None if self.retardance_deg is None else -self.retardance_deg
        return AnalyzerState(self.polarizer_deg, self.retarder_deg, retardance_deg)

    def __str__(self) -> str:
        return str(self.reversed)


def generator_matrix(states: Sequence[GeneratorState]) -> NDArray[np.float64]:
    """The columns of states as rows: shape (N, 4); (N, 3) where none has S3, and (N, 1) where no light is polarized."""
    columns = np.array([state.column() for state in states]).reshape(-1, 4)
    for count in (1, 3):
        if not (np.abs(columns[:, count:]) > _SAME).any():
            return columns[:, :count]
    return columns

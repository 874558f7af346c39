"""What a fit can look for: parameters of surfaces and of the instrument, by name, with the range they make sense in."""

from __future__ import annotations

import math
from dataclasses import dataclass

from model.lobes import Lobe


@dataclass(frozen=True)
class Quantity:
    """One kind of parameter.

    Attributes
    ----------
    meaning : str
        What it is, for a person.
    lowest, highest : float
        No surface or instrument has it beyond these.
    usual : tuple of float
        Bounds of a search where nobody names others.
    logarithmic : bool
        Whether a search spaces it evenly by its logarithm.
    """

    meaning: str
    lowest: float
    highest: float
    usual: tuple[float, float]
    logarithmic: bool = False


_TURN = math.radians(10.0)
_DEGREE = math.radians(1.0)
_WEIGHT = Quantity("weight of a lobe", 0.0, math.inf, (0.0, math.inf))

SURFACE = {
    "sigma": Quantity("rms slope of the surface", 1e-5, 1e5, (0.01, 2.0), logarithmic=True),
    "alpha": Quantity("width of GGX slopes", 1e-5, 1e5, (0.01, 2.0), logarithmic=True),
    "n": Quantity("real part of the refractive index", 1e-3, 1e3, (0.05, 8.0)),
    "k": Quantity("imaginary part of the refractive index", 0.0, 1e3, (0.0, 12.0)),
    "asymmetry": Quantity("asymmetry of the grooves", 0.0, 0.999, (0.0, 0.9)),
    "rho_s": _WEIGHT,
    "rho_d": _WEIGHT,
    "rho_dd": _WEIGHT,
}
"""Parameters of surfaces."""

INSTRUMENT = {
    "incidence_offset_rad": Quantity("true incidence less the one reported", -_TURN, _TURN, (-_DEGREE, _DEGREE)),
    "exit_offset_rad": Quantity(
        "true exit angle less the one reported, counted towards the mirror side", -_TURN, _TURN, (-_DEGREE, _DEGREE)
    ),
    "analyzer_offset_rad": Quantity(
        "true azimuth of the analyzer less the one assumed", -math.pi / 4.0, math.pi / 4.0, (-_DEGREE, _DEGREE)
    ),
    "gain": Quantity("what the instrument reports of 1", 1e-9, 1e9, (0.5, 2.0)),
    "background_per_sr": Quantity("unpolarized light that is not the sample's", -1e9, 1e9, (-1.0, 1.0)),
}
"""Parameters of the instrument, which real scans need."""

NOMINAL = {
    "incidence_offset_rad": 0.0,
    "exit_offset_rad": 0.0,
    "analyzer_offset_rad": 0.0,
    "gain": 1.0,
    "background_per_sr": 0.0,
}
"""What an instrument is taken for where nobody says otherwise."""


def quantity(name: str) -> Quantity:
    """The kind of a parameter: that of its own name, which one of a single lobe has behind a dot.

    Raises
    ------
    KeyError
        If there is none of that name.
    """
    known = {**SURFACE, **INSTRUMENT}
    return known[name.rpartition(".")[2]]


def is_weight(name: str) -> bool:
    """Whether light is proportional to the parameter: whether it is a lobe's weight."""
    return name.startswith("rho_")


def kind_of(lobe: Lobe) -> str:
    """The word for a lobe in the names of its own parameters."""
    return type(lobe).__name__.lower()

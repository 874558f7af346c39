"""A family of surfaces: their lobes, and which parameters are free, held, tied to others or known beforehand."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from model.acceptance import Acceptance
from model.fit.family_faults import family_faults
from model.fit.quantities import INSTRUMENT, NOMINAL, is_weight, kind_of, quantity
from model.lobes import Lobe
from model.surface import Surface

WEIGHTS = {"specular": "rho_s", "diffuse": "rho_d", "directional": "rho_dd"}
"""The weight of each kind of lobe."""


@dataclass(frozen=True)
class SurfaceFamily:
    """Surfaces of the same lobes that differ in the values of parameters, seen by an instrument that may err.

    A parameter is named as in `Surface.parameters`, and is then that of all lobes that have it; ``directional.sigma``
    is that of one kind of lobe alone. Parameters of the instrument are those of `quantities.INSTRUMENT`.

    Parameters
    ----------
    surface : Surface
        The lobes; a parameter that none of the following names stays at the value that it has here.
    free : mapping of str to (low, high)
        Parameters to be found, with their bounds.
    fixed : mapping of str to float
        Parameters that are known, where the surface or a perfect instrument has another value.
    tied : mapping of str to (str, float)
        Parameters that are a factor times another, which is free.
    prior : mapping of str to (mean, standard deviation)
        What is known of free parameters beforehand, as a Gaussian.
    detector_half_angle_rad : float
        Acceptance of the detector that the surfaces are seen with; 0 for single directions.

    Raises
    ------
    ValueError
        If a name is unknown or stands twice, or values are out of order or of range; all that is wrong is named.
    """

    surface: Surface
    free: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float] = field(default_factory=dict)
    tied: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    prior: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    detector_half_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        faults = list(family_faults(self))
        if faults:
            raise ValueError("; ".join(faults) + ".")

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """What the surfaces are made of."""
        return self.surface.lobes

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The free parameters: those that shape the lobes, then the lobes' weights, then the instrument's."""
        ranks = [*_order(self.surface), *INSTRUMENT]
        kinds = [kind_of(lobe) for lobe in self.lobes]

        def rank(name: str) -> tuple[bool, bool, int, int]:
            kind, _, plain = name.rpartition(".")
            return plain in INSTRUMENT, is_weight(plain), ranks.index(plain), kinds.index(kind) if kind else -1

        return tuple(sorted(self.free, key=rank))

    @property
    def shapes(self) -> tuple[str, ...]:
        """The free parameters that shape the lobes."""
        return tuple(name for name in self.names if name not in INSTRUMENT and not is_weight(name))

    @property
    def weights(self) -> tuple[str, ...]:
        """The free weights of lobes."""
        return tuple(name for name in self.names if is_weight(name))

    @property
    def instrument(self) -> tuple[str, ...]:
        """The free parameters of the instrument."""
        return tuple(name for name in self.names if name in INSTRUMENT)

    def key(self, lobe: Lobe, parameter: str) -> str:
        """Under which name a lobe's parameter stands in free, fixed or tied; the shared name if in none."""
        own = f"{kind_of(lobe)}.{parameter}"
        return own if any(own in given for given in (self.free, self.fixed, self.tied)) else parameter

    def held(self, name: str) -> float:
        """The value of an instrument's parameter that is not free."""
        return self.fixed.get(name, NOMINAL[name])

    def lobe_values(self, values: Mapping[str, float]) -> list[dict[str, float]]:
        """The parameters of each lobe, where the free ones have these values; arrays stand for many at once."""
        return [
            {name: self._value(self.key(lobe, name), own, values) for name, own in lobe.values.items()}
            for lobe in self.lobes
        ]

    def _value(self, key: str, own: float, values: Mapping[str, float]) -> float:
        if key in self.tied:
            other, factor = self.tied[key]
            return factor * values[other]
        return values[key] if key in self.free else self.fixed.get(key, own)

    def surface_of(self, values: Mapping[str, float]) -> Surface:
        """The bare surface with these values of the free parameters.

        Raises
        ------
        ValueError
            If a free parameter of the surface is not given.
        """
        missing = [name for name in (*self.shapes, *self.weights) if name not in values]
        if missing:
            raise ValueError(f"the surface needs a value for {', '.join(missing)}; none was given.")
        lobes = [lobe.with_values(own) for lobe, own in zip(self.lobes, self.lobe_values(values), strict=True)]
        # A published model stays that model: it says whose it is.
        surface = copy.copy(self.surface)
        Surface.__init__(surface, lobes)
        return surface

    def seen(self, values: Mapping[str, float]) -> Surface | Acceptance:
        """The surface with these values as the detector sees it."""
        surface = self.surface_of(values)
        return Acceptance(surface, self.detector_half_angle_rad) if self.detector_half_angle_rad else surface

    def holding(self, name: str, value: float) -> SurfaceFamily:
        """The same family with a free parameter held at a value, and with it those that are tied to it."""
        ties = {tied: factor for tied, (other, factor) in self.tied.items() if other == name}
        return replace(
            self,
            free={key: bounds for key, bounds in self.free.items() if key != name},
            fixed={**self.fixed, name: value, **{tied: factor * value for tied, factor in ties.items()}},
            tied={tied: tie for tied, tie in self.tied.items() if tied not in ties},
            prior={key: known for key, known in self.prior.items() if key != name},
        )

    def in_single_directions(self) -> SurfaceFamily:
        """The same family without the detector's cone: fast, and close but for the mirror direction itself."""
        return replace(self, detector_half_angle_rad=0.0)


def whole_family(surface: Surface) -> SurfaceFamily:
    """The family of all surfaces like this one: every parameter free within its usual bounds.

    What this surface does not have stays out: of a real index k stays 0, symmetric grooves stay symmetric.
    """
    free = {}
    for lobe in surface.lobes:
        for name, value in lobe.values.items():
            if value or name not in ("k", "asymmetry"):
                low, high = quantity(name).usual
                free[name] = (min(low, value), max(high, value))
    return SurfaceFamily(surface, free)


def _order(surface: Surface) -> list[str]:
    first = [name for name in ("sigma", "alpha", "n", "k", "asymmetry") if name in surface.parameters]
    return first + [name for name in surface.parameters if name not in first]

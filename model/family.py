"""A family of surfaces: which lobes, which parameters are free and within which bounds, which are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from model.acceptance import Acceptance
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface

WEIGHTS = {"specular": "rho_s", "diffuse": "rho_d", "directional": "rho_dd"}
_SHAPES = {"specular": ("sigma", "n", "k"), "diffuse": ("sigma",), "directional": ("sigma", "n", "k")}
_PARAMETERS = ("sigma", "n", "k", "asymmetry")


@dataclass(frozen=True)
class SurfaceFamily:
    """Surfaces that differ in their parameters only.

    The weights rho_s, rho_d, rho_dd of the lobes are always free and at least 0.

    Parameters
    ----------
    lobes : tuple of str
        Any of "specular", "diffuse", "directional".
    free : mapping of str to (low, high)
        Bounds of those of sigma, n, k that are to be found, and of the asymmetry of the specular lobe's grooves.
    fixed : mapping of str to float
        Values of the others that the lobes need; grooves whose asymmetry is not named are symmetric.
    bounces : int
        Reflections that the specular lobe follows.
    detector_half_angle_rad : float
        Acceptance of the detector that the surfaces are seen with; 0 for single directions.

    Raises
    ------
    ValueError
        If a lobe is unknown, a parameter the lobes need is in neither or both, one that they do not need is in either,
        or bounds are not ordered or leave what is physical (sigma > 0, n > 0, k >= 0, asymmetry from 0 to below 1).
    """

    lobes: tuple[str, ...]
    free: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float] = field(default_factory=dict)
    bounces: int = 1
    detector_half_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        unknown = [name for name in self.lobes if name not in WEIGHTS]
        if unknown or not self.lobes or len(set(self.lobes)) < len(self.lobes):
            raise ValueError(f"lobes are {list(self.lobes)}; name one or more of {list(WEIGHTS)}, each once.")
        needed = {name for lobe in self.lobes for name in _SHAPES[lobe]}
        if "asymmetry" in (*self.free, *self.fixed) and "specular" in self.lobes:
            needed.add("asymmetry")
        given = [*self.free, *self.fixed]
        if sorted(given) != sorted(needed):
            raise ValueError(
                f"free holds {list(self.free)} and fixed holds {list(self.fixed)}; "
                f"the lobes {list(self.lobes)} need each of {sorted(needed)} exactly once, and no other."
            )
        for name, (low, high) in self.free.items():
            if not low < high or not (_is_physical(name, low) and _is_physical(name, high)):
                raise ValueError(
                    f"free bounds of {name} are [{low:g}, {high:g}]; they must increase, with sigma > 0, n > 0, "
                    f"k >= 0, asymmetry from 0 to below 1."
                )
        for name, value in self.fixed.items():
            if not _is_physical(name, value):
                raise ValueError(f"fixed {name} is {value:g}; allowed is sigma > 0, n > 0, k >= 0, asymmetry < 1.")

    @property
    def shapes(self) -> tuple[str, ...]:
        """Names of the free parameters that shape the lobes, in the order sigma, n, k, asymmetry."""
        return tuple(name for name in _PARAMETERS if name in self.free)

    @property
    def weights(self) -> tuple[str, ...]:
        """Names of the lobes' weights, in the order of the lobes."""
        return tuple(WEIGHTS[name] for name in self.lobes)

    def lobe(self, name: str, weight: float, parameters: Mapping[str, float]) -> Lobe:
        """One lobe of the family; the fixed parameters need not be given."""
        values = {**self.fixed, **parameters}
        if name == "diffuse":
            return Diffuse(weight, values["sigma"])
        index = complex(values["n"], values["k"])
        if name == "directional":
            return Directional(weight, values["sigma"], index)
        return Specular(weight, values["sigma"], index, values.get("asymmetry", 0.0), self.bounces)

    def seen(self, lobes: Sequence[Lobe]) -> Surface | Acceptance:
        """A surface of these lobes, as the detector sees it."""
        surface = Surface(lobes)
        return Acceptance(surface, self.detector_half_angle_rad) if self.detector_half_angle_rad else surface

    def surface(self, parameters: Mapping[str, float]) -> Surface | Acceptance:
        """The surface with these parameters, as it is seen; the fixed ones need not be given.

        Raises
        ------
        ValueError
            If a free parameter or a weight is not given.
        """
        missing = [name for name in (*self.shapes, *self.weights) if name not in parameters]
        if missing:
            raise ValueError(f"the surface needs a value for {', '.join(missing)}; none was given.")
        return self.seen([self.lobe(name, parameters[WEIGHTS[name]], parameters) for name in self.lobes])


def _is_physical(name: str, value: float) -> bool:
    if name == "asymmetry":
        return 0.0 <= value < 1.0
    return value >= 0.0 if name == "k" else value > 0.0

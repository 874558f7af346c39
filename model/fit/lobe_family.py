"""Families of surfaces from the names of their lobes, as recipes give them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from model.fit.family import WEIGHTS, SurfaceFamily
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface

_SHAPES = {"specular": ("sigma", "n", "k"), "diffuse": ("sigma",), "directional": ("sigma", "n", "k")}
_UNIT_INDEX = complex(1.5, 0.0)


def lobe_family(
    lobes: Sequence[str],
    free: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float] | None = None,
    *,
    bounces: int = 1,
    detector_half_angle_rad: float = 0.0,
    tied: Mapping[str, tuple[str, float]] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
) -> SurfaceFamily:
    """The family of surfaces made of lobes by name, whose weights are free unless said otherwise.

    Parameters
    ----------
    lobes : sequence of str
        Any of "specular", "diffuse", "directional".
    free, fixed, tied, prior, detector_half_angle_rad
        As for `SurfaceFamily`. Every one of sigma, n, k that the lobes need must stand in free, fixed or tied; grooves
        whose asymmetry is not named are symmetric.
    bounces : int
        Reflections that the specular lobe follows.

    Raises
    ------
    ValueError
        If a lobe is unknown, a parameter the lobes need is not given or one that they do not need is, or a value is out
        of its range.
    """
    fixed, tied = dict(fixed or {}), dict(tied or {})
    if not lobes or any(name not in WEIGHTS for name in lobes) or len(set(lobes)) < len(lobes):
        raise ValueError(f"lobes are {list(lobes)}; name one or more of {list(WEIGHTS)}, each once.")
    given = [*free, *fixed, *tied]
    needed = list(dict.fromkeys(name for lobe in lobes for name in _SHAPES[lobe]))
    optional = ["asymmetry"] if "specular" in lobes else []
    missing = [name for lobe in lobes for name in _SHAPES[lobe] if name not in given and f"{lobe}.{name}" not in given]
    surplus = [name for name in given if "." not in name and name in ("sigma", "n", "k", "asymmetry")]
    surplus = [name for name in surplus if name not in (*needed, *optional)]
    if missing or surplus:
        raise ValueError(
            f"free holds {list(free)} and fixed holds {list(fixed)}; the lobes {list(lobes)} need each of "
            f"{sorted(needed)} exactly once, and no other."
        )
    free_weights = {WEIGHTS[name]: (0.0, math.inf) for name in lobes if WEIGHTS[name] not in (*free, *fixed, *tied)}
    whole: dict[str, Lobe] = {
        "specular": Specular(1.0, 1.0, _UNIT_INDEX, 0.0, bounces),
        "diffuse": Diffuse(1.0, 1.0),
        "directional": Directional(1.0, 1.0, _UNIT_INDEX),
    }
    return SurfaceFamily(
        Surface([whole[name] for name in lobes]),
        {**free, **free_weights},
        fixed,
        tied,
        prior or {},
        detector_half_angle_rad,
    )

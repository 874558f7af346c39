"""The fit section of a recipe: lobes, what is searched, held, tied or known beforehand, and how they are compared."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from acquisition.fit_names import TAKES, WEIGHT, Lobe, SharedName, SurfaceName, domain
from acquisition.fit_names import ParameterName as ParameterName
from acquisition.section import Section, SectionFault, refuse_all

Pair = Annotated[tuple[float, float], Field(strict=False)]
Tie = Annotated[tuple[SurfaceName, float], Field(strict=False)]


def by_parameter(what: str, names: Any, value: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a mapping by parameter, so that editors complete the parameters' names."""
    return {
        "properties": {
            name: {"description": f"{what} of the {domain(name).meaning}: {domain(name)}", **value}
            for name in get_args(names)
        },
        "additionalProperties": False,
    }


_NUMBER = {"type": "number"}


def _pair(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "prefixItems": [first, second], "minItems": 2, "maxItems": 2}


class FitChoice(Section):
    """What to fit: the lobes, and which parameters are searched, held, tied to others or known beforehand.

    Roughness sigma, and n and k when a lobe reflects off facets, each stand once in `free` (with lowest and highest
    value), `fixed` or `tied`, for all lobes or for each by itself (``directional.sigma``). So may the asymmetry of the
    specular lobe's grooves, the lobes' weights, which are free if named nowhere, and what is wrong with the instrument.
    """

    lobes: Annotated[tuple[Lobe, ...], Field(strict=False, min_length=1)] = Field(
        description="lobes of the reflectance: specular, diffuse, directional"
    )
    free: dict[ParameterName, Pair] = Field(
        description="parameters to search, each with lowest and highest value",
        json_schema_extra=by_parameter("lowest and highest value", ParameterName, _pair(_NUMBER, _NUMBER)),
    )
    fixed: dict[ParameterName, float] = Field(
        default={},
        description="parameters that are known and held",
        json_schema_extra=by_parameter("value", ParameterName, _NUMBER),
    )
    tied: dict[SurfaceName, Tie] = Field(
        default={},
        description="parameters that are a factor times a free one, each with the free one's name and the factor",
        json_schema_extra=by_parameter(
            "name of the free parameter, and the factor that makes it that",
            SurfaceName,
            _pair({"enum": list(get_args(SurfaceName))}, _NUMBER),
        ),
    )
    prior: dict[ParameterName, Pair] = Field(
        default={},
        description="what is known of free parameters beforehand, each with mean and standard deviation",
        json_schema_extra=by_parameter("mean and standard deviation", ParameterName, _pair(_NUMBER, _NUMBER)),
    )
    bounces: int = Field(
        default=1,
        ge=1,
        le=12,
        description="reflections inside the grooves that the specular lobe follows; above 1 it is averaged over the "
        "detector's acceptance",
    )
    objective: Literal["stokes", "normalised", "dolp", "rms"] = Field(
        default="stokes",
        description="what is compared: the values as measured, divided by the first, the degree of linear "
        "polarization, or its rms deviation with equal weights",
    )
    robust: bool = Field(default=False, description="whether directions far from the fit count less than by the square")
    search: Literal["sobol", "genetic"] = Field(
        default="sobol", description="how starting values are found: a Sobol sequence, or a genetic search"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(
            [
                *self._lobe_faults(),
                *self._twice_faults(),
                *self._missing_faults(),
                *self._surplus_faults(),
                *self._bounds_faults(),
                *self._tied_faults(),
                *self._prior_faults(),
                *self._scale_faults(),
            ]
        )
        return self

    @property
    def _given(self) -> dict[str, str]:
        """Which group each parameter that is named stands in."""
        groups: dict[str, Mapping[Any, Any]] = {"tied": self.tied, "fixed": self.fixed, "free": self.free}
        return {name: group for group, named in groups.items() for name in named}

    @property
    def _free_weights(self) -> list[str]:
        """Weights that are free because nothing else is said."""
        return [WEIGHT[lobe] for lobe in self.lobes if WEIGHT[lobe] not in self._given]

    @property
    def free_names(self) -> tuple[str, ...]:
        """The parameters that the fit determines: those in free, and weights of which nothing else is said."""
        return (*self.free, *self._free_weights)

    def _lobe_faults(self) -> Iterator[SectionFault]:
        for lobe in dict.fromkeys(self.lobes):
            if self.lobes.count(lobe) > 1:
                yield ("lobes",), f"names '{lobe}' {self.lobes.count(lobe)} times; allowed: each lobe once"
        if self.bounces > 1 and "specular" not in self.lobes:
            yield ("bounces",), "only the specular lobe follows more than one reflection; leave bounces out"

    def _twice_faults(self) -> Iterator[SectionFault]:
        for name in self.fixed:
            if name in self.free:
                yield ("fixed", name), f"{name} stands in free as well; write it in one of the two"
        for name in self.tied:
            for group in ("free", "fixed"):
                if name in getattr(self, group):
                    yield ("tied", name), f"{name} stands in {group} as well; write it in one of the two"

    def _missing_faults(self) -> Iterator[SectionFault]:
        given = self._given
        for name in ("sigma", "n", "k"):
            if any(name in TAKES[lobe] and not {name, f"{lobe}.{name}"} & given.keys() for lobe in self.lobes):
                yield (
                    (),
                    f"{name}, the {domain(name).meaning}, stands neither in free nor in fixed; give its lowest and "
                    "highest value in free, or its value in fixed",
                )

    def _surplus_faults(self) -> Iterator[SectionFault]:
        given = self._given
        absent = [lobe for lobe in TAKES if lobe not in self.lobes]
        surplus: dict[str, str] = {WEIGHT[lobe]: f"there is no {lobe} lobe in lobes; leave it out" for lobe in absent}
        surplus |= {f"{lobe}.{name}": surplus[WEIGHT[lobe]] for lobe in absent for name in TAKES[lobe]}
        for name in get_args(SharedName):
            takers = [lobe for lobe in self.lobes if name in TAKES[lobe]]
            if not takers and name == "asymmetry":
                surplus[name] = "only the specular lobe depends on asymmetry; leave it out"
            elif not takers:
                surplus[name] = f"the diffuse lobe alone does not depend on {name}; leave it out"
            elif all(f"{lobe}.{name}" in given for lobe in takers):
                surplus[name] = f"every lobe that depends on {name} has its own; leave this one out"
        for name, what in surplus.items():
            if name in given:
                yield (given[name], name), what

    def _bounds_faults(self) -> Iterator[SectionFault]:
        for name, bounds in self.free.items():
            low, high = bounds
            if not low < high:
                yield ("free", name), f"got [{low:g}, {high:g}]; allowed: the lowest value, then a higher one"
            elif not all(map(domain(name).holds, bounds)):
                yield ("free", name), f"got [{low:g}, {high:g}]; allowed: both {domain(name)}"
        for name, value in self.fixed.items():
            if not domain(name).holds(value):
                yield ("fixed", name), f"got {value:g}; allowed: {domain(name)}"

    def _tied_faults(self) -> Iterator[SectionFault]:
        for name, (other, factor) in self.tied.items():
            if other not in (*self.free, *self._free_weights):
                yield ("tied", name), f"is tied to {other}, which is not free; tie it to a parameter that is"
            elif factor <= 0.0:
                yield ("tied", name), f"got the factor {factor:g}; allowed: a number greater than 0"
            elif not all(domain(name).holds(factor * bound) for bound in self.free.get(other, ())):
                low, high = (factor * bound for bound in self.free[other])
                yield ("tied", name), f"could become {low:g} to {high:g} with {other}; allowed: {domain(name)}"

    def _prior_faults(self) -> Iterator[SectionFault]:
        for name, (mean, stddev) in self.prior.items():
            low, high = self.free.get(name, (0.0, math.inf))
            if name not in (*self.free, *self._free_weights):
                yield ("prior", name), f"{name} is not free; leave its prior out, or give it bounds in free"
            elif stddev <= 0.0:
                yield ("prior", name), f"got [{mean:g}, {stddev:g}]; allowed: a mean, then a deviation greater than 0"
            elif low < high and not low <= mean <= high:
                yield ("prior", name), f"got the mean {mean:g}; allowed: {low:g} to {high:g}, the bounds of {name}"

    def _scale_faults(self) -> Iterator[SectionFault]:
        """A gain that data cannot tell from weights, and errors that equal weights do not have."""
        weights = {WEIGHT[lobe] for lobe in self.lobes}
        is_known = weights & self.fixed.keys() or {"gain", *weights} & self.prior.keys()
        if self.objective != "stokes":
            yield from self.ratio_faults(f"the objective {self.objective}")
        elif "gain" in self.free and not is_known:
            yield (
                ("free", "gain"),
                "no weight is known, and the data show only the product of gain and weights; write a weight in fixed, "
                "give one of them a prior, or leave gain out",
            )
        if self.robust and self.objective == "rms":
            yield ("robust",), "the objective rms knows no errors by which a direction is far; leave robust out"

    def ratio_faults(self, what: str) -> Iterator[SectionFault]:
        """What makes no sense where only ratios of light are compared; `what` is it that knows no more."""
        if "gain" in self.free:
            yield ("free", "gain"), f"{what} does not depend on the gain; leave it out"
        weights = [WEIGHT[lobe] for lobe in self.lobes]
        if any(name in self.fixed for name in weights):
            return
        for group, named in (("free", self.free), ("prior", self.prior)):
            for name in weights:
                if name in named:
                    known = f"{what} knows weights only by their ratios"
                    yield (group, name), f"{known}; write one of the weights in fixed, or leave {name} out"

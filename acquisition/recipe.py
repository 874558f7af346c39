"""The recipe: what to measure and what to fit, as a user writes it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from acquisition.analyzer_matrix import check_analyzer_set
from acquisition.section import Section, SectionFault, refuse_all

Lobe = Literal["specular", "diffuse", "directional"]
ParameterName = Literal["sigma", "n", "k", "asymmetry"]
ExitAngle = Annotated[float, Field(ge=-85, le=85)]
AnalyzerAngle = Annotated[float, Field(ge=-360, le=360)]
Bounds = Annotated[tuple[float, float], Field(strict=False)]

MAX_DIRECTIONS = 1_000_000
"""More exit angles than any scan has: a step that was mistyped is found before memory is full."""

_GRID_TOLERANCE_DEG = 1e-9


@dataclass(frozen=True)
class _Domain:
    """The values of a parameter that make sense: from `low` to `high`."""

    meaning: str
    low: float
    high: float

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high

    def __str__(self) -> str:
        return f"from {self.low:g} to {self.high:g}"


_DOMAIN = {
    "sigma": _Domain("rms slope of the surface", 1e-5, 10.0),
    "n": _Domain("real part of the refractive index", 0.05, 20.0),
    "k": _Domain("imaginary part of the refractive index", 0.0, 100.0),
    "asymmetry": _Domain("asymmetry of the grooves", 0.0, 0.99),
}


def _parameters_schema(what: str, value: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a mapping by parameter, so that editors complete the parameters' names."""
    return {
        "properties": {
            name: {"description": f"{what} of the {domain.meaning}: {domain}", **value}
            for name, domain in _DOMAIN.items()
        },
        "additionalProperties": False,
    }


_NUMBER = {"type": "number"}
_PAIR = {"type": "array", "prefixItems": [_NUMBER, _NUMBER], "minItems": 2, "maxItems": 2}


class ExitRange(Section):
    """Exit angles on an even grid; negative angles lie on the source's side of the surface normal."""

    start_deg: ExitAngle = Field(description="first exit angle, in degrees")
    stop_deg: ExitAngle = Field(description="last exit angle, in degrees; measured when it lies on the grid")
    step_deg: float = Field(gt=0, description="distance of neighbouring exit angles, in degrees")

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        steps = (self.stop_deg - self.start_deg) / self.step_deg
        if steps < 0:
            yield ("stop_deg",), f"got {self.stop_deg:g}; allowed: start_deg, which is {self.start_deg:g}, or above"
        elif steps >= MAX_DIRECTIONS:
            yield (
                ("step_deg",),
                f"got {self.step_deg:g}, which makes {steps:.3g} exit angles; allowed: at most {MAX_DIRECTIONS} angles",
            )

    def angles_deg(self) -> tuple[float, ...]:
        """All angles, each computed from the first so that no error builds up."""
        steps = (self.stop_deg - self.start_deg) / self.step_deg
        last = round(steps)
        if abs(self.start_deg + last * self.step_deg - self.stop_deg) <= _GRID_TOLERANCE_DEG:
            return (*(self.start_deg + i * self.step_deg for i in range(last)), self.stop_deg)
        return tuple(self.start_deg + i * self.step_deg for i in range(math.floor(steps) + 1))


class Reference(Section):
    """Readings through the open slot in one fixed direction, which follow the lamp."""

    exit_deg: ExitAngle = Field(description="exit angle of the reference reading, in degrees")
    every_points: int = Field(ge=1, le=MAX_DIRECTIONS, description="number of directions between two references")


class FitChoice(Section):
    """What to fit: the lobes, and which parameters are searched or held.

    The lobes' weights are always free. Roughness sigma, and n and k when a lobe reflects off facets, each stand once in
    `free` (with lowest and highest value) or in `fixed`; so may the asymmetry of the specular lobe's grooves.
    """

    lobes: Annotated[tuple[Lobe, ...], Field(strict=False, min_length=1)] = Field(
        description="lobes of the reflectance: specular, diffuse, directional"
    )
    free: dict[ParameterName, Bounds] = Field(
        description="parameters to search, each with lowest and highest value",
        json_schema_extra=_parameters_schema("lowest and highest value", _PAIR),
    )
    fixed: dict[ParameterName, float] = Field(
        default={},
        description="parameters that are known and held",
        json_schema_extra=_parameters_schema("value", _NUMBER),
    )
    bounces: int = Field(
        default=1,
        ge=1,
        le=12,
        description="reflections inside the grooves that the specular lobe follows; above 1 it is averaged over the "
        "detector's acceptance",
    )
    search: Literal["sobol", "genetic"] = Field(
        default="sobol", description="how starting values are found: a Sobol sequence, or a genetic search"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all([*self._lobe_faults(), *self._presence_faults(), *self._value_faults()])
        return self

    def _lobe_faults(self) -> Iterator[SectionFault]:
        for lobe in dict.fromkeys(self.lobes):
            if self.lobes.count(lobe) > 1:
                yield ("lobes",), f"names '{lobe}' {self.lobes.count(lobe)} times; allowed: each lobe once"

    def _presence_faults(self) -> Iterator[SectionFault]:
        has_facets = "specular" in self.lobes or "directional" in self.lobes
        for name, domain in _DOMAIN.items():
            if name == "asymmetry":
                yield from self._asymmetry_faults()
                continue
            needed = name == "sigma" or has_facets
            if name in self.free and name in self.fixed:
                yield ("fixed", name), f"{name} stands in free as well; write it in one of the two"
            elif needed and name not in self.free and name not in self.fixed:
                yield (
                    (),
                    f"{name}, the {domain.meaning}, stands neither in free nor in fixed; give its lowest and highest "
                    "value in free, or its value in fixed",
                )
            elif not needed and (name in self.free or name in self.fixed):
                section = "free" if name in self.free else "fixed"
                yield (section, name), f"the diffuse lobe alone does not depend on {name}; leave it out"

    def _asymmetry_faults(self) -> Iterator[SectionFault]:
        if "asymmetry" in self.free and "asymmetry" in self.fixed:
            yield ("fixed", "asymmetry"), "asymmetry stands in free as well; write it in one of the two"
        elif "specular" not in self.lobes:
            for section in ("free", "fixed"):
                if "asymmetry" in getattr(self, section):
                    yield (section, "asymmetry"), "only the specular lobe depends on asymmetry; leave it out"
            if self.bounces > 1:
                yield ("bounces",), "only the specular lobe follows more than one reflection; leave bounces out"

    def _value_faults(self) -> Iterator[SectionFault]:
        for name, bounds in self.free.items():
            low, high = bounds
            if not low < high:
                yield ("free", name), f"got [{low:g}, {high:g}]; allowed: the lowest value, then a higher one"
            elif not all(map(_DOMAIN[name].holds, bounds)):
                yield ("free", name), f"got [{low:g}, {high:g}]; allowed: both {_DOMAIN[name]}"
        for name, value in self.fixed.items():
            if not _DOMAIN[name].holds(value):
                yield ("fixed", name), f"got {value:g}; allowed: {_DOMAIN[name]}"


def _check_printable(name: str) -> str:
    if not name.isprintable():
        raise ValueError("holds a character that cannot be printed; write the name without control characters")
    return name


class Recipe(Section):
    """A measurement: directions, analyzer angles, readings, and the fit."""

    recipe: Annotated[str, AfterValidator(_check_printable)] = Field(
        min_length=1, max_length=200, description="name of the measurement, for a person"
    )
    rig: str = Field(min_length=1, description="rig file; a relative path starts at this file's folder")
    scene: str | None = Field(
        default=None,
        min_length=1,
        description="scene file that a simulated rig holds; a relative path starts at this file's folder; "
        "not used on real devices",
    )
    wavelength_nm: float = Field(ge=200, le=2500, description="wavelength of the light, in nm")
    incidence_deg: float = Field(ge=0, le=89, description="angle of incidence from the surface normal, in degrees")
    exit: ExitRange | None = Field(default=None, description="exit angles on an even grid; or write exit_deg")
    exit_deg: Annotated[tuple[ExitAngle, ...], Field(strict=False)] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_DIRECTIONS,
        description="list of exit angles, in degrees; or write exit",
    )
    azimuth_deg: float = Field(
        default=0.0, ge=-360, le=360, description="angle of the sample about its normal, in degrees"
    )
    analyzer_deg: Annotated[tuple[AnalyzerAngle, ...], Field(strict=False, min_length=3)] = Field(
        description="at least 3 polarizer angles, in degrees, as the rig's slots name them"
    )
    dark: bool = Field(default=True, description="whether to read the blocked slot in every direction")
    reference: Reference | None = Field(default=None, description="readings that follow the lamp; leave out for none")
    readings: int = Field(ge=1, le=1000, description="number of readings in every slot")
    exposure_s: float = Field(gt=0, le=3600, description="duration of one reading, in s")
    fit: FitChoice = Field(description="what to fit to the Stokes parameters")

    @field_validator("analyzer_deg")
    @classmethod
    def _check_analyzer(cls, angles_deg: tuple[float, ...]) -> tuple[float, ...]:
        for angle in dict.fromkeys(angles_deg):
            if angles_deg.count(angle) > 1:
                raise ValueError(
                    f"the angle {angle:g} stands {angles_deg.count(angle)} times; allowed: each angle once "
                    "(readings says how often each is read)"
                )
        check_analyzer_set(angles_deg)
        return angles_deg

    @model_validator(mode="after")
    def _check_exit(self) -> Self:
        if (self.exit is None) == (self.exit_deg is None):
            found = "neither" if self.exit is None else "both"
            raise ValueError(
                f"found {found} of the keys exit and exit_deg; write one of them, for example "
                "'exit: {start_deg: 0, stop_deg: 60, step_deg: 1}' or 'exit_deg: [0, 30, 60]'"
            )
        return self

    def exit_angles_deg(self) -> tuple[float, ...]:
        """Return all exit angles in degrees, in the order in which they are measured."""
        if self.exit is not None:
            return self.exit.angles_deg()
        return self.exit_deg or ()

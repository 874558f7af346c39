"""Readings until a wanted precision is reached, as a recipe asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, model_validator

from acquisition.section import Section, SectionFault, refuse_all

MAX_READINGS = 10_000
LEAST_RATIO = 5.0
"""Signal-to-noise ratio below which nobody can tell beforehand, from a few readings, how many it takes."""

Readings = Annotated[int, Field(ge=1, le=MAX_READINGS)]


class Averaging(Section):
    """Readings in every slot until a signal-to-noise ratio, or until a standard error of the DoLP, is reached."""

    at_least: Readings = Field(description="least number of readings in every slot")
    at_most: Readings = Field(description="number of readings in every slot after which the scan goes on in any case")
    signal_to_noise: float | None = Field(
        default=None,
        ge=LEAST_RATIO,
        le=1_000_000,
        description="wanted mean power of each slot in units of its own standard error; or write dolp_error",
    )
    dolp_error: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="wanted standard error of the degree of linear polarization; or write signal_to_noise",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        if self.at_most <= self.at_least:
            yield (
                ("at_most",),
                f"got {self.at_most}; allowed: more than at_least, which is {self.at_least}. For a fixed number write "
                f"'readings: {self.at_least}'",
            )
        if (self.signal_to_noise is None) == (self.dolp_error is None):
            found = "neither" if self.dolp_error is None else "both"
            yield (
                (),
                f"found {found} of the keys signal_to_noise and dolp_error; write one of them, for example "
                "'readings: {at_least: 2, at_most: 60, signal_to_noise: 200}'",
            )

    def __str__(self) -> str:
        wanted = "the DoLP is known to ±" if self.signal_to_noise is None else "signal-to-noise"
        value = self.dolp_error if self.signal_to_noise is None else self.signal_to_noise
        return f"{self.at_least} to {self.at_most} readings in every slot until {wanted} {value:g}"


def _kind(value: Any) -> str:
    if isinstance(value, dict | Averaging):
        return "Averaging"
    return "list" if isinstance(value, list | tuple) else "number"


HowOften = Annotated[
    Annotated[Readings, Tag("number")]
    | Annotated[tuple[Readings, ...], Field(strict=False), Tag("list")]
    | Annotated[Averaging, Tag("Averaging")],
    Discriminator(_kind),
]
"""A number of readings, a list of them, or what is to be reached."""

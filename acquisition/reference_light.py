"""Light whose polarization is known, by which an analyzer is calibrated: what is known of it, and how well."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from acquisition.exit_angles import ExitAngle
from acquisition.section import Section, SectionFault, refuse_all


@dataclass(frozen=True)
class Known:
    """Something on which a reference's light depends, how well it is known, and whether it is one for all scans."""

    name: str
    value: float
    stderr: float
    is_shared: bool = True


_ANY_POLARIZATION = 0.5
"""Standard deviation of S1/S0 and S2/S0 of light that may be polarized in any way."""

_SAME_DEG = 1.0
"""Angles of a polarizer nearer than this do not count as two."""

PolarizerAngle = Annotated[float, Field(ge=-360, le=360)]


class PolarizerReference(Section):
    """A polarizer in front of the analyzer, turned by hand to one angle after another."""

    reference: Literal["polarizer"] = Field(description="what is measured")
    angles_deg: Annotated[tuple[PolarizerAngle, ...], Field(strict=False, min_length=1)] = Field(
        description="its angles from the s-direction, in degrees, counted as those of the analyzer are; at least 4 "
        "different ones in all"
    )
    zero_stderr_deg: float = Field(ge=0, le=45, description="standard error of its mount's zero, in degrees")
    setting_stderr_deg: float = Field(ge=0, le=5, description="standard error of setting one angle, in degrees")
    extinction_ratio: float = Field(ge=1e3, le=1e12, description="its transmittance along its axis over that across it")
    incidence_deg: float = Field(ge=0, le=85, description="angle of incidence on the sample, in degrees")
    exit_deg: ExitAngle = Field(description="exit angle; choose one where the sample is bright, in degrees")

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        for number, angle in enumerate(self.angles_deg):
            for other in self.angles_deg[:number]:
                if abs(math.remainder(angle - other, 180.0)) < _SAME_DEG:
                    yield (
                        ("angles_deg", number),
                        f"got {angle:g}, which is {other:g} again: a polarizer turned by 180 degrees is the same "
                        "polarizer. Leave it out (readings says how often each is read)",
                    )
                    break

    def directions(self) -> tuple[tuple[float, float], ...]:
        """Incidence and exit angle of each state of the light in one scan, in degrees."""
        return ((self.incidence_deg, self.exit_deg),)

    def hand_settings_deg(self) -> tuple[float | None, ...]:
        """To what a person turns the reference, a scan each, in degrees."""
        return self.angles_deg

    def known(self) -> tuple[Known, ...]:
        """What its light depends on; the zero is one for all scans, a setting is each scan's own."""
        return (
            Known("the reference polarizer's zero", 0.0, self.zero_stderr_deg),
            Known("the setting of the reference polarizer", 0.0, self.setting_stderr_deg, is_shared=False),
            Known("S1/S0 before the reference polarizer", 0.0, _ANY_POLARIZATION),
            Known("S2/S0 before the reference polarizer", 0.0, _ANY_POLARIZATION),
        )

    def light(
        self, setting_deg: float | None, half_angle_deg: float, values: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """S0, S1, S2 over S0 behind the polarizer, for `values` of what is `known`.

        Across its axis it passes the amplitude √e of what reaches it, with e the inverse of its extinction ratio: light
        that comes polarized leaves it turned, twice the angle by 2 √e q for a share q polarized at 45 degrees to its
        axis (to first order in both), and, in whatever phase the two amplitudes are, by no more.
        """
        assert setting_deg is not None, "a scan of a polarizer has its angle"
        zero_deg, error_deg, s1, s2 = values
        leak, twice = 1.0 / self.extinction_ratio, math.radians(2.0 * (setting_deg + zero_deg + error_deg))
        twice += 2.0 * math.sqrt(leak) * (s2 * math.cos(twice) - s1 * math.sin(twice))
        degree = (1.0 - leak) / (1.0 + leak)
        return np.array([1.0, degree * math.cos(twice), degree * math.sin(twice)])

    def __str__(self) -> str:
        angles = ", ".join(f"{angle:g}" for angle in self.angles_deg)
        return (
            f"polarizer at {angles} deg, zero ± {self.zero_stderr_deg:g}, settings ± {self.setting_stderr_deg:g}, "
            f"extinction ratio {self.extinction_ratio:g}"
        )


class PlateReference(Section):
    """A polished plate of known refractive index in the sample's place, seen in its mirror direction."""

    reference: Literal["plate"] = Field(description="what is measured")
    incidence_deg: Annotated[tuple[Annotated[float, Field(gt=0, le=85)], ...], Field(strict=False, min_length=1)] = (
        Field(description="angles of incidence, in degrees; the exit angle is the same")
    )
    n: float = Field(ge=1e-3, le=20, description="real part of its refractive index")
    n_stderr: float = Field(ge=0, le=1, description="standard error of n")
    k: float = Field(default=0.0, ge=0, le=20, description="imaginary part, 0 for glass")
    k_stderr: float = Field(default=0.0, ge=0, le=1, description="standard error of k")
    incidence_stderr_deg: float = Field(ge=0, le=5, description="standard error of the zero of the angles, in degrees")

    def directions(self) -> tuple[tuple[float, float], ...]:
        """Incidence and exit angle of each state of the light in one scan, in degrees."""
        return tuple((angle, angle) for angle in self.incidence_deg)

    def hand_settings_deg(self) -> tuple[float | None, ...]:
        """Nothing is turned by hand: one scan."""
        return (None,)

    def known(self) -> tuple[Known, ...]:
        """What its light depends on."""
        return (
            Known("the plate's n", self.n, self.n_stderr),
            Known("the plate's k", self.k, self.k_stderr),
            Known("the zero of the plate's incidence", 0.0, self.incidence_stderr_deg),
        )

    def light(
        self, setting_deg: float | None, half_angle_deg: float, values: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """S0, S1, S2 over S0 of unpolarized light reflected at an incidence of `half_angle_deg`; Fresnel's equations.

        With c the cosine of the incidence and w = √(N² - 1 + c²), r_s = (c - w)/(c + w) and
        r_p = (N² c - w)/(N² c + w).
        """
        n, k, offset_deg = values
        index_squared, cos = complex(n, k) ** 2, math.cos(math.radians(half_angle_deg + offset_deg))
        root = (index_squared - 1.0 + cos**2) ** 0.5
        s = abs((cos - root) / (cos + root)) ** 2
        p = abs((index_squared * cos - root) / (index_squared * cos + root)) ** 2
        return np.array([1.0, (s - p) / (s + p), 0.0])

    def __str__(self) -> str:
        angles = ", ".join(f"{angle:g}" for angle in self.incidence_deg)
        return f"plate of n = {self.n:g} ± {self.n_stderr:g}, k = {self.k:g} ± {self.k_stderr:g} at {angles} deg"


AnyReference: Any = Annotated[PolarizerReference | PlateReference, Field(discriminator="reference")]
ReferenceLight = PolarizerReference | PlateReference

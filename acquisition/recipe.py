"""The recipe: what to measure and what to fit, as a user writes it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any, Self, get_args

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from acquisition.analyzer_matrix import check_analyzer_set
from acquisition.averaging import MAX_READINGS as MAX_READINGS
from acquisition.averaging import Averaging, HowOften
from acquisition.exit_angles import MAX_DIRECTIONS, ExitAngle
from acquisition.exit_angles import WIDEST_EXIT_DEG as WIDEST_EXIT_DEG
from acquisition.exit_angles import ExitRange as ExitRange
from acquisition.fit_choice import FitChoice as FitChoice
from acquisition.fit_choice import ParameterName
from acquisition.generator_choice import generator_faults, generator_settings, purpose_faults
from acquisition.imaging.choice import Imaging, imaging_faults
from acquisition.lamp_level import LARGEST_CHANGE
from acquisition.recipe_directions import RecipeDirections
from acquisition.rotation import AnalyzerRotation, rotation_faults
from acquisition.section import Section, SectionFault, refuse_all
from acquisition.suspend import Suspend
from acquisition.wavelengths import Wavelengths, wavelength_faults

AnalyzerAngle = Annotated[float, Field(ge=-360, le=360)]

StandardError = Annotated[float, Field(gt=0)]

WITHIN_S = 60.0
"""In a minute the light of a lamp that has warmed up changes by less than a tenth of a percent."""

FEWEST_CHOICES, MOST_CHOICES = 4, 200
"""Exit angles among which an adaptive scan chooses: fewer are no choice, more take longer to weigh than is worth it."""

_BY_PARAMETER: dict[str, Any] = {
    "properties": {
        name: {"description": f"wanted standard error of {name}", "type": "number", "exclusiveMinimum": 0}
        for name in get_args(ParameterName)
    },
    "additionalProperties": False,
}


class Reference(Section):
    """Readings through the open slot in one fixed direction, which follow the lamp."""

    exit_deg: ExitAngle = Field(description="exit angle of the reference reading, in degrees")
    every_points: int = Field(ge=1, le=MAX_DIRECTIONS, description="number of directions between two references")
    largest_change: float = Field(
        default=LARGEST_CHANGE,
        gt=0,
        lt=1,
        description="relative change of the lamp from one reference to the next at which the scan ends",
    )


def check_printable(name: str) -> str:
    """Refuse a name that would not show as it is; raises ValueError."""
    if not name.isprintable():
        raise ValueError("holds a character that cannot be printed; write the name without control characters")
    return name


class Recipe(RecipeDirections):
    """A measurement: directions, analyzer angles, readings, and the fit."""

    recipe: Annotated[str, AfterValidator(check_printable)] = Field(
        min_length=1, max_length=200, description="name of the measurement, for a person"
    )
    rig: str = Field(min_length=1, description="rig file; a relative path starts at this file's folder")
    scene: str | None = Field(
        default=None,
        min_length=1,
        description="scene file that a simulated rig holds; a relative path starts at this file's folder; "
        "not used on real devices",
    )
    wavelength_nm: Wavelengths = Field(
        description="wavelength of the light, in nm; or several, as a list of those of the rig's filters"
    )
    retarder_deg: Annotated[tuple[AnalyzerAngle, ...], Field(strict=False)] | None = Field(
        default=None,
        description="one angle of the retarder's fast axis for each of analyzer_deg, in degrees, as the rig's slots "
        "name them; leave out where there is no retarder",
    )
    analyzer_deg: Annotated[tuple[AnalyzerAngle, ...], Field(strict=False, min_length=3)] = Field(
        default=(),
        description="at least 3 polarizer angles, in degrees, as the rig's slots name them; 4 for S3, with "
        "retarder_deg",
    )
    analyzer_rotation: AnalyzerRotation | None = Field(
        default=None,
        description="in place of analyzer_deg: the analyzer turns while it is read, readings times in a turn",
    )
    generator_deg: Annotated[tuple[AnalyzerAngle, ...], Field(strict=False)] | None = Field(
        default=None,
        min_length=3,
        description="at least 3 polarizer angles of the generator in the source arm, in degrees, as its slots name "
        "them, for Mueller matrices: every one is read with every analyzer setting; leave out without a generator",
    )
    generator_retarder_deg: Annotated[tuple[AnalyzerAngle, ...], Field(strict=False)] | None = Field(
        default=None,
        description="one angle of the generator's retarder for each of generator_deg, in degrees; leave out where it "
        "has none",
    )
    calibration: str | None = Field(
        default=None,
        min_length=1,
        description="file in which goniometer calibrate has stored what it found of the analyzer; a relative path "
        "starts at this file's folder; leave out to take the rig's polarizers to be ideal",
    )
    calibration_max_age_days: float | None = Field(
        default=None,
        gt=0,
        le=36500,
        description="age of the calibration, and of the arms' zeros, beyond which nothing is measured, in days",
    )
    dark: bool = Field(default=True, description="whether to read the blocked slot in every direction")
    reference: Reference | None = Field(default=None, description="readings that follow the lamp; leave out for none")
    readings: HowOften = Field(
        description="number of readings in every slot, 1 to 10000; or a list with one number for each exit angle, or "
        "for each of points; or a group with at_least, at_most, and either signal_to_noise or dolp_error, which the "
        "readings are to reach"
    )
    exposure_s: float = Field(gt=0, le=3600, description="duration of one reading, in s")
    direction_within_s: float = Field(
        default=WITHIN_S,
        ge=0,
        le=1_000_000,
        description="how far apart in time the readings of one direction may lie, in s: the scan may sweep many "
        "directions in each slot where that is quicker; 0: every direction in one go",
    )
    suspend: Suspend | None = Field(
        default=None, description="when the scan waits by itself until a reading is beyond doubt; leave out for never"
    )
    fit: FitChoice = Field(description="what to fit to the Stokes parameters")
    imaging: Imaging | None = Field(
        default=None, description="which maps to make of a camera's pictures; leave out for none"
    )
    until: Annotated[dict[ParameterName, StandardError], Field(min_length=1)] | None = Field(
        default=None,
        description="standard errors wanted of free parameters: the scan ends once they are reached, and is repeated "
        "until then",
        json_schema_extra=_BY_PARAMETER,
    )
    adaptive: bool = Field(
        default=False,
        description="whether the scan itself chooses, among the exit angles, where to measure next and for how long",
    )
    time_limit_s: float | None = Field(
        default=None,
        gt=0,
        le=1_000_000,
        description="time after which a scan with until or adaptive begins no further direction, in s",
    )

    @field_validator("analyzer_deg")
    @classmethod
    def _check_analyzer(cls, angles_deg: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if info.data.get("retarder_deg", ()) is not None:
            return angles_deg  # what a retarder tells depends on its retardance, which the rig knows
        for angle in dict.fromkeys(angles_deg):
            if angles_deg.count(angle) > 1:
                raise ValueError(
                    f"the angle {angle:g} stands {angles_deg.count(angle)} times; allowed: each angle once "
                    "(readings says how often each is read)"
                )
        check_analyzer_set(angles_deg)
        return angles_deg

    @model_validator(mode="after")
    def _check_rotation(self) -> Self:
        refuse_all(rotation_faults(self))
        return self

    @model_validator(mode="after")
    def _check_readings(self) -> Self:
        angles, named = len(self.exit_angles_deg()), "exit angles"
        if self.has_points:
            angles, named = len(self.directions_deg()), "points"
        if isinstance(self.readings, tuple) and len(self.readings) != angles:
            what = (
                f"got a list of {len(self.readings)}; allowed: one number for each of the {angles} {named}, or one "
                "for all"
            )
            refuse_all([(("readings",), what)])
        return self

    @model_validator(mode="after")
    def _check_suspend(self) -> Self:
        if self.suspend is not None and self.suspend.lamp_below is not None and self.reference is None:
            what = "compares reference readings; add for example 'reference: {exit_deg: 45, every_points: 10}'"
            refuse_all([(("suspend", "lamp_below"), what)])
        return self

    @model_validator(mode="after")
    def _check_retarder(self) -> Self:
        refuse_all(self._retarder_faults())
        return self

    def _retarder_faults(self) -> Iterator[SectionFault]:
        if self.retarder_deg is None:
            return
        if len(self.retarder_deg) != len(self.analyzer_deg):
            yield (
                ("retarder_deg",),
                f"got {len(self.retarder_deg)} angles; allowed: {len(self.analyzer_deg)}, one for each of analyzer_deg",
            )
            return
        for pair, times in Counter(self.settings()).items():
            if times > 1:
                yield (
                    ("retarder_deg",),
                    f"the angle {pair[1]:g} goes with the polarizer angle {pair[0]:g} {times} times; allowed: each "
                    "pair once (readings says how often each is read)",
                )

    @model_validator(mode="after")
    def _check_generator(self) -> Self:
        refuse_all(generator_faults(self.generator_deg, self.generator_retarder_deg))
        if self.generator_deg is not None:
            refuse_all(purpose_faults(self.fit.objective, adaptive=self.adaptive))
        return self

    @model_validator(mode="after")
    def _check_calibration(self) -> Self:
        if self.calibration is not None and self.calibration_max_age_days is None:
            refuse_all([(("calibration",), "needs calibration_max_age_days beside it; add it, or leave both out")])
        return self

    @model_validator(mode="after")
    def _check_wavelengths(self) -> Self:
        refuse_all(wavelength_faults(self))
        return self

    @model_validator(mode="after")
    def _check_imaging(self) -> Self:
        refuse_all(imaging_faults(self))
        return self

    @model_validator(mode="after")
    def _check_steering(self) -> Self:
        refuse_all([*self._limit_faults(), *self._plane_faults(), *self._until_faults(), *self._adaptive_faults()])
        return self

    def wavelengths_nm(self) -> tuple[float, ...]:
        """The wavelengths in nm, as they are listed."""
        return self.wavelength_nm if isinstance(self.wavelength_nm, tuple) else (self.wavelength_nm,)

    def at_wavelength(self, wavelength_nm: float) -> Self:
        """The same with one of its wavelengths alone."""
        return self.model_copy(update={"wavelength_nm": wavelength_nm})

    @property
    def one_wavelength_nm(self) -> float:
        """The wavelength in nm, of a recipe that has only one."""
        (wavelength_nm,) = self.wavelengths_nm()
        return wavelength_nm

    @property
    def is_steered(self) -> bool:
        """Whether the scan decides as it goes where it measures, how often, or when it ends."""
        return self.follows_fit or self.averaging is not None

    @property
    def follows_fit(self) -> bool:
        """Whether a fit decides as the scan goes."""
        return self.adaptive or self.until is not None

    @property
    def averaging(self) -> Averaging | None:
        """What the readings of every slot or direction are to reach; None for fixed numbers."""
        return self.readings if isinstance(self.readings, Averaging) else None

    @property
    def wanted(self) -> dict[str, float]:
        """The standard errors that end the scan; none if nothing is wanted."""
        return {str(name): error for name, error in (self.until or {}).items()}

    def _limit_faults(self) -> Iterator[SectionFault]:
        if self.follows_fit and self.averaging is not None:
            yield (
                ("readings",),
                "got a group of keys; a scan with until or adaptive decides by its fit how often it measures. "
                f"Write the least number, {self.averaging.at_least}",
            )
        if self.follows_fit and self.time_limit_s is None:
            key = "adaptive" if self.until is None else "until"
            yield (
                (key,),
                "needs a time limit, at which the scan ends whatever it has found; add for example 'time_limit_s: 600'",
            )
        if self.time_limit_s is not None and not self.follows_fit:
            yield (
                ("time_limit_s",),
                "is for a scan that decides by itself when to end; add until or adaptive, or leave it out",
            )

    def _plane_faults(self) -> Iterator[SectionFault]:
        if not self.is_steered:
            return
        key = "adaptive" if self.adaptive else "until" if self.until else "at_most"
        if self.follows_fit and not self.is_one_plane:
            what = "a list of points" if self.has_points else self.several_planes
            yield (
                (key,),
                f"chooses among exit angles only; {what} cannot be measured so. Leave {key} out, or write one angle of "
                "each",
            )
        if self.repeats > 1:
            yield ("repeats",), f"a scan with {key} goes on by itself for as long as it needs; leave repeats out"

    def _until_faults(self) -> Iterator[SectionFault]:
        free = self.fit.free_names
        for name in self.wanted:
            if name not in free:
                yield ("until", name), f"{name} is not free in fit; allowed: {', '.join(free)}"
            elif name.startswith("rho_") and self.fit.objective != "stokes":
                yield (
                    ("until", name),
                    f"the objective {self.fit.objective} knows weights only by their ratios; leave {name} out",
                )
        if self.until is not None and self.fit.objective == "rms":
            yield ("until",), "the objective rms has no chi-square by which a fit could be doubted; choose another one"

    def _adaptive_faults(self) -> Iterator[SectionFault]:
        if not self.adaptive:
            return
        choices = len(set(self.exit_angles_deg()))
        if not FEWEST_CHOICES <= choices <= MOST_CHOICES:
            yield (
                ("adaptive",),
                f"the scan would choose among {choices} exit angles; allowed: {FEWEST_CHOICES} to {MOST_CHOICES}",
            )
        if isinstance(self.readings, tuple):
            yield ("readings",), "got a list; an adaptive scan stays as long as it pays: write the least number instead"
        if not self.fit.free_names:
            yield ("adaptive",), "nothing is free in fit, so there is nothing to find out; free a parameter"
        if self.fit.objective != "stokes":
            yield (
                ("adaptive",),
                f"plans by what Stokes parameters tell, but the objective is {self.fit.objective}; allowed: stokes",
            )

    def settings(self) -> tuple[tuple[float, float | None], ...]:
        """Return the analyzer's settings: angles of polarizer and retarder, None without one, as the rig names them."""
        return tuple(zip(self.analyzer_deg, self.retarder_deg or (None,) * len(self.analyzer_deg), strict=True))

    def generator_settings(self) -> tuple[tuple[float, float | None], ...]:
        """Return the generator's settings as `settings` does the analyzer's; none at all without a generator."""
        return generator_settings(self.generator_deg, self.generator_retarder_deg)

    def readings_of_angles(self) -> tuple[int, ...]:
        """How many readings each exit angle of a product, or each point of a list, gets in every slot, at most."""
        if isinstance(self.readings, tuple):
            return self.readings
        most = self.readings.at_most if isinstance(self.readings, Averaging) else self.readings
        return (most,) * (len(self.exit_angles_deg()) or len(self.directions_deg()))

    def readings_of_directions(self) -> tuple[int, ...]:
        """How many readings each direction gets in every slot, at most, by its number."""
        return self.readings_of_angles() * (self.planes or 1)

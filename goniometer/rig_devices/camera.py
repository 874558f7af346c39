"""What all cameras of a rig file have in common: the picture, the part of it that is a detector, sensor and lens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from acquisition.detector_noise import NoiseModel
from acquisition.imaging.light.camera_noise import camera_noise
from acquisition.imaging.place.optics import Optics
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from acquisition.section import Section, SectionFault, refuse_all
from acquisition.timing import READING_S, DetectorTiming
from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from goniometer.rig_devices.entry import DetectorEntry

_TRANSFER_S_PER_PIXEL = 4e-8
"""Two bytes of a pixel on gigabit Ethernet, and their decoding."""

_LONGEST_S = 3600

Size = Annotated[int, Field(ge=1, le=65536)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Distortion = Annotated[tuple[float, float, float, float, float], Field(strict=False)]


class RegionEntry(Section):
    """The part of the picture over which the camera is read as a detector."""

    left: int = Field(ge=0, description="its first column, counted from 0")
    top: int = Field(ge=0, description="its first row, counted from 0")
    width: int = Field(ge=1, description="in pixels")
    height: int = Field(ge=1, description="in pixels")

    @property
    def region(self) -> Region:
        """The rectangle."""
        return Region(self.left, self.top, self.width, self.height)


class SensorEntry(Section):
    """The sensor's noise, at gain 0 dB, and its linearity."""

    read_counts: float = Field(
        gt=0, le=65535, description="standard deviation of a pixel in the dark, in counts at gain 0 dB"
    )
    electrons_per_count: float = Field(gt=0, le=1e6, description="electrons that a count stands for at gain 0 dB")
    black_counts: float | None = Field(
        default=None,
        ge=0,
        le=65535,
        description="counts without light in the shortest exposure, at the gain that is set; needed for readings of "
        "several exposures, else dark readings show it: 0 if left out",
    )
    linearity: Annotated[tuple[Pair, ...], Field(strict=False)] | None = Field(
        default=None,
        description="pairs [counts, true counts], both rising, black level included; in between on straight lines. "
        "Left out: the sensor is linear",
    )

    @model_validator(mode="after")
    def _check_linearity(self) -> Self:
        refuse_all(_linearity_faults(self.linearity))
        return self

    @property
    def noise(self) -> SensorNoise:
        """The noise of one pixel."""
        return SensorNoise(self.read_counts, self.electrons_per_count)


class OpticsEntry(Section):
    """The lens, as OpenCV describes it."""

    focal_px: float = Field(gt=0, le=1e6, description="focal length over the size of a pixel")
    centre_px: Pair = Field(description="column and row where the optical axis meets the picture")
    distortion: Distortion = Field(default=(0.0, 0.0, 0.0, 0.0, 0.0), description="k1, k2, p1, p2, k3")

    @property
    def optics(self) -> Optics:
        """The lens."""
        return Optics(self.focal_px, self.centre_px, self.distortion)


class CameraEntry(DetectorEntry):
    """A camera; read as a detector, it is the mean over a region of its pictures."""

    sees_whole_spot: ClassVar[bool] = False
    to_dim: ClassVar[str] = (
        "make exposure_s in the recipe shorter, or gain_db in the rig file lower (not below 0), or weaken the beam"
    )

    sample_s: float = Field(
        default=1e-6, gt=0, le=10, description="step in which it sets its exposure, in s; 1e-6 if left out"
    )
    width_px: Size = Field(description="width of its pictures")
    height_px: Size = Field(description="height of its pictures")
    bits: int = Field(ge=8, le=16, description="bits of a pixel's counts")
    gain_db: float = Field(default=0.0, ge=-60, le=120, description="gain that it is told, in dB of voltage")
    warm_up_frames: int = Field(
        default=2, ge=1, le=1000, description="pictures that are taken and thrown away when it is connected"
    )
    region: RegionEntry = Field(description="the part of the picture over which it is read as a detector")
    watts_per_count_per_s: float = Field(
        gt=0, le=1, description="optical power on one pixel that makes one count per second at gain 0 dB, in W"
    )
    saturation_counts: int | None = Field(
        default=None,
        ge=1,
        description="counts from which on a pixel is saturated at gain 0 dB, and at higher gains; at lower ones it is "
        "from proportionally fewer; the most that there are if left out",
    )
    most_saturated: float = Field(
        default=0.0, ge=0, lt=1, description="share of the region's pixels that may be saturated, and are then left out"
    )
    readout_s: float = Field(
        default=0.0, ge=0, le=60, description="time from the end of an exposure until the picture is sent, in s"
    )
    sensor: SensorEntry = Field(description="noise and linearity of the sensor")
    optics: OpticsEntry | None = Field(
        default=None, description="the lens; needed for maps in the sample's coordinates"
    )
    flat: str | None = Field(default=None, description="file of every pixel's sensitivity")
    bad_pixels: str | None = Field(default=None, description="file of the pixels that are not to be used")

    @model_validator(mode="after")
    def _check_picture(self) -> Self:
        refuse_all(self._picture_faults())
        return self

    def _picture_faults(self) -> Iterator[SectionFault]:
        region = self.region
        if not region.region.fits(self.width_px, self.height_px):
            yield (
                ("region",),
                f"reaches column {region.left + region.width - 1} and row {region.top + region.height - 1}; allowed: "
                f"at most {self.width_px - 1} and {self.height_px - 1}, the last ones of width_px and height_px",
            )
        if self.saturated_from > self.largest_counts:
            yield (
                ("saturation_counts",),
                f"got {self.saturation_counts}; allowed: at most {self.largest_counts}, the most that {self.bits} bits "
                "hold",
            )
        yield from self._linearity_range_faults()

    def _linearity_range_faults(self) -> Iterator[SectionFault]:
        """What would be refused when the pictures have been taken."""
        table, key = self.sensor.linearity, ("sensor", "linearity")
        if not table:
            return
        if table[0][0] > 0:
            yield key, f"begins at {table[0][0]:g} counts; allowed: 0"
        if table[-1][0] > self.largest_counts:
            yield (
                key,
                f"reaches {table[-1][0]:g} counts; allowed: at most {self.largest_counts}, the most that {self.bits} "
                "bits hold",
            )
        if table[-1][0] < self.saturated_from - 1:
            yield (
                key,
                f"ends at {table[-1][0]:g} counts; allowed: up to saturation at {self.saturated_from}, which is "
                "saturation_counts",
            )
        if self.gain_db != 0.0:
            yield key, f"holds at gain 0 dB, and gain_db is {self.gain_db:g}; allowed: gain_db 0, or no table"

    @property
    def largest_counts(self) -> int:
        """Where the converter ends."""
        return (1 << self.bits) - 1

    @property
    def saturated_from(self) -> int:
        """Counts from which on a pixel says nothing at gain 0 dB."""
        return self.largest_counts if self.saturation_counts is None else self.saturation_counts

    @property
    def most_samples(self) -> int:
        """As many steps of the exposure as an hour has; how long it really may be the camera says itself."""
        return max(1, round(_LONGEST_S / self.sample_s))

    @property
    def timing(self) -> DetectorTiming:
        """Behind the exposure the picture is read out, sent and decoded."""
        return DetectorTiming(READING_S + self.readout_s + self.width_px * self.height_px * _TRANSFER_S_PER_PIXEL)

    def noise_model(self, wavelength_nm: float) -> NoiseModel:
        """The noise of the region's mean, which follows from the sensor's."""
        pixels = self.region.width * self.region.height
        return camera_noise(self.sensor.noise, self.watts_per_count_per_s, pixels, wavelength_nm)

    def photometer(self, name: str) -> Photometer:
        """What turns the pictures of the camera of this name into readings."""
        return Photometer(
            name,
            region=self.region.region,
            watts_per_count_per_s=self.watts_per_count_per_s,
            saturation_counts=self.saturated_from,
            most_saturated=self.most_saturated,
            black_counts=self.sensor.black_counts or 0.0,
            to_dim=self.to_dim,
        )


def _linearity_faults(pairs: Sequence[tuple[float, float]] | None) -> Iterator[SectionFault]:
    if pairs is None:
        return
    if len(pairs) < 2:
        yield ("linearity",), f"has {len(pairs)} pairs; allowed: two or more"
    for number, (before, after) in enumerate(pairwise(pairs), start=1):
        if not (before[0] < after[0] and before[1] < after[1]):
            yield (
                ("linearity", number),
                f"got [{after[0]:g}, {after[1]:g}] behind [{before[0]:g}, {before[1]:g}]; allowed: both higher",
            )

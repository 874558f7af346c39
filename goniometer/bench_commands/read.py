"""`goniometer read`: where everything stands, and the power at the detector."""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass
from pathlib import Path

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.protocols import Camera
from drivers.camera.region import RegionMean
from goniometer.bench_commands.measuring import select, take_reading_w, whole_samples_s
from goniometer.bench_commands.open_bench import Tell, open_bench, roles_of
from goniometer.errors import ConfigurationError, GoniometerError, SaturatedError
from goniometer.plus_minus import plus_minus
from goniometer.rig_devices.entry import Slot


@dataclass(frozen=True)
class BenchReading:
    """What a bench shows.

    Attributes
    ----------
    positions_deg : dict of str to float
        Where each axis says it is, by role.
    not_homed : tuple of str
        The axes whose position means nothing, because they do not know their zero.
    slot, holds : int, float, AnalyzerState or str
        The slot in the beam, and what the rig file says is in it: a polarizer's angle in degrees, polarizer and
        retarder, open, or blocked; None where the analyzer stands at none of its slots.
    exposure_s : float
        Of one reading.
    readings_w : tuple of float
        The readings, in order, in W.
    power_w, stddev_w : float
        Their mean and the standard deviation of one of them, in W; None for a single reading.
    region : RegionMean or None
        Counts in the region of a camera's last picture.
    """

    positions_deg: dict[str, float]
    not_homed: tuple[str, ...]
    slot: int | None
    holds: Slot | AnalyzerState | None
    exposure_s: float
    readings_w: tuple[float, ...]
    power_w: float
    stddev_w: float | None
    region: RegionMean | None = None

    def __str__(self) -> str:
        width = max(15, *(len(role) + 1 for role in self.positions_deg))
        lines = [
            f"{role:<{width}}{position_deg:z10.4f}°"
            f"{'  not homed: this position means nothing' * (role in self.not_homed)}"
            for role, position_deg in self.positions_deg.items()
        ]
        holds: object = self.holds or ""
        if isinstance(self.holds, AnalyzerState):
            holds = f"polarizer at {self.holds.polarizer_deg:g}° behind a retarder at {self.holds.retarder_deg:g}°"
        elif isinstance(self.holds, float):
            holds = f"polarizer at {self.holds:g}°"
        lines.append(f"{'slot':<{width}}{self.slot or 'none':>10}   {holds}".rstrip())
        number = len(self.readings_w)
        about = f"one reading of {self.exposure_s:g} s"
        if self.stddev_w is not None:
            about = f"mean of {number} readings of {self.exposure_s:g} s ± standard deviation of one"
        lines.append(f"{'power':<{width}}{plus_minus(self.power_w, self.stddev_w)} W   {about}")
        if self.region is not None:
            counts = plus_minus(self.region.mean_counts, math.sqrt(self.region.variance_counts2))
            about = f"mean of the region's {self.region.pixels} pixels ± standard deviation of one"
            lines.append(f"{'picture':<{width}}{counts} counts   {about}")
        return "\n".join(lines)


def read(
    rig_path: Path,
    exposure_s: float,
    slot: int | None,
    count: int,
    note: Tell,
    *,
    picture: Path | None = None,
    trace: Path | None = None,
) -> BenchReading:
    """Read positions, slot and power; nothing moves but the analyzer, and only to a `slot` that was asked for.

    The last picture of a camera goes into the PNG file `picture`, saturated or not.

    Raises
    ------
    ConfigurationError
        When the exposure is too long for the detector, or a picture is asked of one that is no camera.
    DeviceError
        When a device fails, an axis moves already, or the detector is saturated.
    """
    with open_bench(rig_path, note, trace) as opened:
        exposure_s = whole_samples_s(opened.rig.detector, exposure_s)
        if slot is not None:
            select(opened, slot)
        axes = {role: opened.axes[role] for role in roles_of(opened.rig)}
        in_beam = opened.analyzer.slot()
        held = {**opened.rig.analyzer.contents(), **opened.rig.analyzer.retarded()}
        camera = opened.detector if isinstance(opened.detector, Camera) else None
        if picture is not None and camera is None:
            raise ConfigurationError([f"The detector of {rig_path} is no camera, and takes no picture"])
        try:
            readings_w = tuple(take_reading_w(opened, exposure_s) for _ in range(count))
        except SaturatedError:
            if camera is not None and picture is not None:
                _write_picture(camera, picture)
            raise
        if camera is not None and picture is not None:
            _write_picture(camera, picture)
        return BenchReading(
            positions_deg={role: axis.position_deg() for role, axis in axes.items()},
            not_homed=tuple(role for role, axis in axes.items() if not axis.is_homed()),
            slot=in_beam,
            holds=None if in_beam is None else held[in_beam],
            exposure_s=exposure_s,
            readings_w=readings_w,
            power_w=statistics.fmean(readings_w),
            stddev_w=statistics.stdev(readings_w) if count > 1 else None,
            region=None if camera is None else camera.read(),
        )


def _write_picture(camera: Camera, path: Path) -> None:
    import cv2

    _, encoded = cv2.imencode(".png", camera.frame().counts)
    try:
        path.write_bytes(encoded.tobytes())
    except OSError as error:
        raise GoniometerError(f"The picture {path} cannot be written: {error}. Nothing was moved.") from error

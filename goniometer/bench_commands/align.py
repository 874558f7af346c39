"""`goniometer align`: an arm's true zero, from the mirror direction of a mirror in the sample's place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.optimize import nnls

from drivers.motion import refuse_outside
from goniometer.bench_commands.measuring import USUAL_EXPOSURE_S, select, take_reading_w, whole_samples_s
from goniometer.bench_commands.open_bench import OpenBench, Tell, open_bench
from goniometer.bench_commands.peak import Floats, Peak, fit_peak
from goniometer.bench_commands.rewritten_rig import MeasuredZero, store_zero
from goniometer.errors import ConfigurationError
from goniometer.plus_minus import plus_minus

Arm = Literal["source_arm", "detector_arm"]

_OTHER: dict[Arm, Arm] = {"source_arm": "detector_arm", "detector_arm": "source_arm"}
_READINGS = 3
_USUAL_STEPS = 40
_FEWEST_POINTS, _MOST_POINTS = 9, 2000


@dataclass(frozen=True)
class Alignment:
    """Where the mirror direction was found, and what follows for the arm's zero.

    Attributes
    ----------
    arm : str
        The arm that was scanned.
    mirror_deg : float
        Where the mirror direction should be: the other arm's angle.
    peak : Peak
        Where it is.
    old_zero_deg, zero_deg, uncertainty_deg : float
        `zero_deg` of the rig file as it was, as it should be, and how well that is known: the peak's uncertainty, the
        tolerance within which the other arm stands, and the mirror's roughness.
    scan : tuple of tuple of float
        Angle in degrees, and mean power and its standard deviation in W, of every point.
    measured : str
        When, in ISO 8601 with the time zone.
    stored : bool
        Whether the rig file has the new zero.
    """

    arm: Arm
    mirror_deg: float
    peak: Peak
    old_zero_deg: float
    zero_deg: float
    uncertainty_deg: float
    scan: tuple[tuple[float, float, float], ...]
    measured: str
    stored: bool

    @property
    def zero(self) -> MeasuredZero:
        """What a rig file says of it."""
        return MeasuredZero(self.zero_deg, self.uncertainty_deg, self.measured)

    def __str__(self) -> str:
        peak = self.peak
        lines = [
            f"peak of {peak.height_w:.4g} W, {peak.fwhm_deg:.3g}° wide at half of its height, at "
            f"{plus_minus(peak.centre_deg, self.uncertainty_deg)}°; the {_OTHER[self.arm]} says that it should be at "
            f"{self.mirror_deg:.4f}°",
            f"{self.arm}: zero_deg should be {plus_minus(self.zero_deg, self.uncertainty_deg)}, and is "
            f"{self.old_zero_deg:g}",
        ]
        if peak.left_out:
            left_out = ", ".join(f"{angle_deg:g}°" for angle_deg in peak.left_out)
            lines.insert(1, f"left out of the fit, because they stand far off it: the points at {left_out}")
        return "\n".join(lines)


def align(
    rig_path: Path,
    arm: Arm,
    from_deg: float,
    to_deg: float,
    step_deg: float | None,
    tell: Tell,
    *,
    store: bool,
    trace: Path | None = None,
) -> Alignment:
    """Scan an arm across the mirror direction and find the zero at which mirror direction and arm agree.

    Both arms are measured from the sample's normal, so that the detector sees the mirror's reflection where its angle
    equals the source's. Only the sum of both arms' errors, and of twice the sample's tilt, can be seen like this: it is
    all given to the arm that is scanned.

    Parameters
    ----------
    rig_path : Path
        The rig file.
    arm : str
        The arm to scan; the other one stays where it stands.
    from_deg, to_deg : float
        Where the scan begins and ends, on the arm's present scale, in degrees.
    step_deg : float, optional
        Between two points; a fortieth of the way when not given.
    tell : callable
        Takes what happens.
    store : bool
        Whether to write the new zero into the rig file.
    trace : Path, optional
        Where every byte sent and received is written down.

    Raises
    ------
    ConfigurationError
        When the scan asked for makes no sense here; nothing was moved.
    LimitError, CollisionError
        When a part of it is forbidden; nothing was moved.
    FitError
        When the scan shows no peak whose centre is the mirror direction.
    """
    targets_deg = _targets_deg(from_deg, to_deg, step_deg)
    with open_bench(rig_path, tell, trace) as opened:
        axis, mirror_deg = opened.axes[arm], opened.axes[_OTHER[arm]].position_deg()
        _refuse_out_of_plane(opened)
        if not from_deg < mirror_deg < to_deg:
            raise ConfigurationError(
                [
                    f"The {_OTHER[arm]} stands at {mirror_deg:.4f} degrees, so the mirror direction is there too, "
                    f"outside --from {from_deg:g} and --to {to_deg:g}. Nothing was moved. Move the {_OTHER[arm]}, or "
                    "scan around its angle"
                ]
            )
        for end_deg in (from_deg, to_deg):
            refuse_outside(arm, end_deg, axis.travel.reachable_deg)
        if axis.permit is not None:
            axis.permit([*axis.way_deg(axis.position_deg(), from_deg), to_deg])
        scan = _scan(opened, arm, targets_deg, tell)
        old_zero_deg = opened.rig.axes()[arm].zero_deg
        standing_deg = opened.axes[_OTHER[arm]].tolerance_deg / math.sqrt(3)
    angle_deg, power_w, stddev_w = np.array(scan).T
    peak = fit_peak(angle_deg, power_w, _smoothed_stddev_w(power_w, stddev_w))
    zero_deg = old_zero_deg + peak.centre_deg - mirror_deg
    uncertainty_deg = math.hypot(peak.uncertainty_deg, standing_deg, _roughness_deg(peak, mirror_deg))
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    found = Alignment(arm, mirror_deg, peak, old_zero_deg, zero_deg, uncertainty_deg, tuple(scan), now, store)
    if store:
        store_zero(rig_path, arm, found.zero)
    return found


def _refuse_out_of_plane(opened: OpenBench) -> None:
    """The mirror direction lies in the plane of incidence."""
    turned = opened.axes.get("detector_azimuth")
    if turned is not None and abs(turned.position_deg()) > turned.tolerance_deg:
        raise ConfigurationError(
            [
                f"The detector_azimuth stands at {turned.position_deg():.4f} degrees, and the mirror direction lies in "
                "the plane of incidence, at 0. Nothing was moved. Move it there first: goniometer move --rig RIG "
                "detector_azimuth 0"
            ]
        )


def advice(found: Alignment, rig_path: Path) -> str:
    """What was, or is to be, done with the rig file."""
    if found.stored:
        return f"{rig_path}: wrote for {found.arm}, whose zero_deg was {found.old_zero_deg:g}, {found.zero}"
    keys = "\n".join(f"        {key}: {value}" for key, value in found.zero.keys.items())
    return f"Nothing was stored. Write these lines for {found.arm} into {rig_path}, or add --store:\n{keys}"


def _roughness_deg(peak: Peak, mirror_deg: float) -> float:
    """By how much the peak of a rough mirror may be shifted, and yet be symmetric.

    A Gaussian lobe times a cosine of the angle, or its inverse, is the same lobe at another place: its variance times
    the tangent away. A lobe that is wide for another reason is shifted by less.
    """
    variance = math.radians(peak.fwhm_deg) ** 2 / (8 * math.log(2))
    return math.degrees(variance * abs(math.tan(math.radians(mirror_deg))))


def _targets_deg(from_deg: float, to_deg: float, step_deg: float | None) -> Floats:
    if not from_deg < to_deg:
        raise ConfigurationError(
            [f"--from {from_deg:g} is not below --to {to_deg:g}. Nothing was moved. Exchange them"]
        )
    step_deg = step_deg or (to_deg - from_deg) / _USUAL_STEPS
    points = int(np.floor((to_deg - from_deg) / step_deg + 1e-9)) + 1
    if not _FEWEST_POINTS <= points <= _MOST_POINTS:
        raise ConfigurationError(
            [
                f"--step {step_deg:g} makes {points} points from {from_deg:g} to {to_deg:g}; allowed: {_FEWEST_POINTS} "
                f"to {_MOST_POINTS}. Nothing was moved. Change the step"
            ]
        )
    return np.asarray(from_deg + step_deg * np.arange(points), np.float64)


def _scan(opened: OpenBench, arm: Arm, targets_deg: Floats, tell: Tell) -> list[tuple[float, float, float]]:
    """Angle as read back, mean power and standard deviation of one reading, of every point; upwards."""
    exposure_s = whole_samples_s(opened.rig.detector, USUAL_EXPOSURE_S)
    contents = opened.rig.analyzer.contents()
    slot = min(contents, key=lambda slot: (contents[slot] != "open", contents[slot] == "blocked", slot))
    select(opened, slot)
    tell(
        f"{arm}: {targets_deg.size} points from {targets_deg[0]:g}° to {targets_deg[-1]:g}°, {_READINGS} readings of "
        f"{exposure_s:g} s each, through slot {slot} ({contents[slot]})"
    )
    axis, scan = opened.axes[arm], []
    for target_deg in targets_deg:
        axis.start_move(float(target_deg))
        opened.until_at_rest(axis)
        readings_w = [take_reading_w(opened, exposure_s) for _ in range(_READINGS)]
        scan.append((axis.position_deg(), float(np.mean(readings_w)), float(np.std(readings_w, ddof=1))))
        tell(f"{scan[-1][0]:10.4f}°  {scan[-1][1]:.4e} W")
    return scan


def _smoothed_stddev_w(power_w: Floats, stddev_w: Floats) -> Floats:
    """Standard deviations of the means: the scatter of a few readings, as a constant and a part that grows with power.

    The few readings of one point alone would give points a weight by chance.
    """
    scale_w = float(np.max(np.abs(power_w))) or 1.0
    parts = np.column_stack([np.ones_like(power_w), np.maximum(power_w, 0.0) / scale_w])
    variance, _ = nnls(parts, (stddev_w / scale_w) ** 2)
    return np.asarray(scale_w * np.sqrt(parts @ variance / _READINGS), np.float64)

"""The exposures that a rig's detector can have."""

from __future__ import annotations

from goniometer.errors import LimitError
from goniometer.rig_file import Rig


def nearest_exposure(rig: Rig, exposure_s: float) -> float:
    """The whole number of the detector's samples that is nearest to an exposure.

    Raises
    ------
    LimitError
        When the exposure is no positive number, or longer than the detector averages.
    """
    longest_s = rig.detector.most_samples * rig.detector.sample_s
    if not 0 < exposure_s <= longest_s * (1 + 1e-9):
        name = next(name for name, device in rig.devices.items() if device is rig.detector)
        raise LimitError(
            name,
            f"an exposure of {exposure_s:g} s is not between 0 and {longest_s:g} s, the {rig.detector.most_samples} "
            f"samples of {rig.detector.sample_s:g} s that it averages at most",
            not_done="the exposure was not changed",
            to_do="ask for one within these limits",
        )
    return max(1, round(exposure_s / rig.detector.sample_s)) * rig.detector.sample_s

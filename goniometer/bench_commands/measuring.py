"""Readings that a command takes: with a slot in the beam, for a time that the detector can keep."""

from __future__ import annotations

from acquisition.timing import READING_POLL_S
from goniometer.bench_commands.open_bench import OpenBench
from goniometer.errors import ConfigurationError
from goniometer.rig_devices.entry import DetectorEntry

USUAL_EXPOSURE_S = 0.1


def whole_samples_s(detector: DetectorEntry, exposure_s: float) -> float:
    """The exposure of as many whole samples, one at least, as come nearest to what was asked for.

    Raises
    ------
    ConfigurationError
        When they are more than the detector averages.
    """
    samples = max(1, round(exposure_s / detector.sample_s))
    if samples > detector.most_samples:
        longest_s = detector.most_samples * detector.sample_s
        raise ConfigurationError(
            [
                f"An exposure of {exposure_s:g} s is too long: the detector averages {longest_s:g} s at most. "
                "Take more readings instead"
            ]
        )
    return samples * detector.sample_s


def select(opened: OpenBench, slot: int) -> None:
    """Bring a slot into the beam; raises LimitError for one that the analyzer has not."""
    analyzer = opened.analyzer
    if analyzer.slot() != slot:
        analyzer.start_select(slot)
        opened.until_at_rest(analyzer)


def take_reading_w(opened: OpenBench, exposure_s: float) -> float:
    """One reading, in W; raises DeviceFaultError when the detector was saturated."""
    detector = opened.detector
    detector.start_reading(exposure_s)
    opened.wait(READING_POLL_S)
    while detector.is_reading():
        opened.wait(READING_POLL_S)
    return detector.power_w()

"""A region of a camera's pictures, read as a detector of optical power."""

from __future__ import annotations

from drivers.camera.frame import Frame
from drivers.camera.region import Region, RegionMean
from drivers.camera.saturation import saturated_from
from goniometer.errors import ReplyError, SaturatedError


class Photometer:
    """What turns pictures into readings.

    Parameters
    ----------
    name : str
        The camera's name in the rig file.
    region : Region
        Over which the counts are averaged.
    watts_per_count_per_s : float
        Power on one pixel that makes one count per second at gain 0 dB.
    saturation_counts : int
        From here on a pixel is saturated at gain 0 dB; at a lower gain it is from fewer.
    most_saturated : float
        Share of the region's pixels that may be; they are left out of the mean.
    black_counts : float
        Counts of every pixel without light and in no time, whatever the gain.
    to_dim : str
        What a person can do against saturation.
    """

    def __init__(
        self,
        name: str,
        *,
        region: Region,
        watts_per_count_per_s: float,
        saturation_counts: int,
        most_saturated: float = 0.0,
        black_counts: float = 0.0,
        to_dim: str = "weaken the beam",
    ) -> None:
        self.name, self.region = name, region
        self._watts_per_count_per_s = watts_per_count_per_s
        self._saturation_counts, self._most_saturated = saturation_counts, most_saturated
        self._black_counts, self._to_dim = black_counts, to_dim

    def mean(self, frame: Frame | None) -> RegionMean:
        """Mean and variance of the counts over the region.

        Raises
        ------
        SaturatedError
            When too many of its pixels are saturated.
        ReplyError
            When there is no frame.
        """
        frame = self.finished(frame)
        limit_counts = saturated_from(self._saturation_counts, frame.gain_db)
        saturated, pixels = self.region.saturated(frame, limit_counts), self.region.width * self.region.height
        if saturated > self._most_saturated * pixels:
            raise SaturatedError(
                self.name,
                f"the detector was saturated: {saturated} of the region's {pixels} pixels have "
                f"{limit_counts} counts or more at {frame.exposure_s:g} s and {frame.gain_db:g} dB",
                not_done="the reading was thrown away",
                to_do=self._to_dim,
            )
        return self.region.mean(frame, limit_counts)

    def power_w(self, frame: Frame | None) -> float:
        """Mean power on a pixel of the region, in watts, dark current included; raises as `mean` does."""
        mean_counts = self.mean(frame).mean_counts - self._black_counts
        frame = self.finished(frame)
        gain = 10 ** (frame.gain_db / 20)
        return mean_counts / gain / frame.exposure_s * self._watts_per_count_per_s

    def finished(self, frame: Frame | None) -> Frame:
        """The frame; raises ReplyError when there is none."""
        if frame is None:
            raise ReplyError(
                self.name,
                "there is no finished reading",
                not_done="no picture and no power was returned",
                to_do="begin a reading, and ask for it when it has ended",
            )
        return frame

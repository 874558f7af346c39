"""What a camera is asked for, and what its still pictures are to be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from drivers.camera.status import CameraStatus

STILL = "/still.png?exposure_s={exposure_s}&gain_db={gain_db}&bits={bits}"
_HEADERS_BYTES = 1 << 16


@dataclass(frozen=True)
class StillSettings:
    """Settings of all pictures of one camera.

    Parameters
    ----------
    width, height : int
        In pixels.
    bits : int
        Of the counts, 8 to 16.
    gain_db : float
        As it is told; 0 where `still` tells none, so that all figures are those of the gain that it has.
    still : str
        Path of a picture, with `{exposure_s}`, `{gain_db}` and `{bits}` in it.
    exposure_step_s : float
        Step in which the camera sets its exposure.
    readout_s : float
        From the end of an exposure until the picture begins to come.
    warm_up_frames : int
        Pictures thrown away when it is connected.
    """

    width: int
    height: int
    bits: int
    gain_db: float = 0.0
    still: str = STILL
    exposure_step_s: float = 1e-6
    readout_s: float = 0.0
    warm_up_frames: int = 2

    @property
    def most_bytes(self) -> int:
        """Longest file: where pixels are noise, some ways to pack them make it longer than the pixels."""
        return 4 * self.width * self.height + _HEADERS_BYTES

    def path(self, exposure_s: float) -> str:
        """What a picture of this exposure is asked for with."""
        return self.still.format(exposure_s=f"{exposure_s:.9g}", gain_db=f"{self.gain_db:.9g}", bits=self.bits)

    def contradictions(self, status: CameraStatus) -> Iterator[str]:
        """Where a camera says that its pictures are otherwise."""
        return status.contradictions(width=self.width, height=self.height, bits=self.bits, gain_db=self.gain_db)

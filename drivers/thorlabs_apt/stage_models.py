"""The rotation stages on Thorlabs' APT controllers: how many counts a degree has, and how speeds are written."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.thorlabs_apt.messages import Velocity


@dataclass(frozen=True)
class AptStage:
    """One model of stage.

    Parameters
    ----------
    controllers : tuple of str
        Models of controller that drive it, as they name themselves.
    counts_per_deg : float
        Motor or encoder counts in one degree.
    velocity_scale, acceleration_scale : float
        The controller's velocity for 1 count/s, and its acceleration for 1 count/s².
    has_dc_motor : bool
        Whether the controller answers with the status of DC and brushless motors.
    """

    controllers: tuple[str, ...]
    counts_per_deg: float
    velocity_scale: float
    acceleration_scale: float
    has_dc_motor: bool

    def words(self, velocity_deg_s: float, acceleration_deg_s2: float) -> Velocity:
        """Velocity and acceleration as the controller writes them."""
        return Velocity(
            acceleration=round(acceleration_deg_s2 * self.counts_per_deg * self.acceleration_scale),
            velocity=round(velocity_deg_s * self.counts_per_deg * self.velocity_scale),
        )

    def speeds(self, words: Velocity) -> tuple[float, float]:
        """Velocity in degrees/s and acceleration in degrees/s², from how the controller writes them."""
        return (
            words.velocity / (self.counts_per_deg * self.velocity_scale),
            words.acceleration / (self.counts_per_deg * self.acceleration_scale),
        )


def _stepper(counts_per_deg: float, *controllers: str) -> AptStage:
    return AptStage(controllers, counts_per_deg, 53.68, 53.68 * 204.94e-6, has_dc_motor=False)


def _servo(counts_per_deg: float, sampling_s: float, *controllers: str) -> AptStage:
    """A motor whose controller counts its speed in 1/65536 of a count for each sampling time."""
    return AptStage(controllers, counts_per_deg, 65536 * sampling_s, 65536 * sampling_s**2, has_dc_motor=True)


APT_STAGES = {
    "K10CR1": _stepper(49_152_000 / 360, "K10CR1"),
    "HDR50": _stepper(75_091, "BSC201", "BSC202", "BSC203"),
    "PRM1Z8": _servo(1919.6419, 2048 / 6e6, "KDC101", "TDC001"),
    "DDR100": _servo(9102.22, 102.4e-6, "KBD101"),
    "DDR25": _servo(4000, 102.4e-6, "KBD101"),
}
"""The stages by model."""

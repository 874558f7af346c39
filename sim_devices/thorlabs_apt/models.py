"""The Thorlabs APT controllers with their stages: scales, speeds and habits."""

from __future__ import annotations

from dataclasses import dataclass, replace

# a stepper's velocity and acceleration words count microsteps on its 53.68 kHz clock
_STEPPER_VELOCITY, _STEPPER_ACCELERATION = 53.68, 53.68 * 204.94e-6
# a servo's count encoder steps a sampling interval, in 1/65536
_DC_S, _BRUSHLESS_S = 2048 / 6e6, 102.4e-6
_SPEED_STEPS = 65536


@dataclass(frozen=True)
class AptModel:
    """A controller with its stage.

    Parameters
    ----------
    name : str
        Model as the controller tells it, up to 8 characters; a rack's lacks its last digit, the number of its bays.
    serial_number : int
        Begins with the two digits of its type.
    hardware_type : int
        As told with the serial number.
    counts_per_deg : float
        Counts of position.
    velocity_word, acceleration_word : float
        Per count/s and count/s².
    velocity_deg_s, acceleration_deg_s2 : float
        Settings after power-on; the stage turns no faster than that velocity.
    home_velocity_deg_s, home_offset_deg : float
        Settings after power-on. With that offset, the home position is at 0 deg of the axis.
    turn_limit : int
        Turns either way from the counter's zero beyond which the controller does not turn.
    is_rack : bool
        Whether motors are addressed by bay.
    is_servo : bool
        Whether the motor is a DC or brushless servo, with status messages of its own kind.
    completes_empty_moves : bool
        Whether a move to where the stage stands is reported as completed.
    completes_with_status : bool
        Whether a completed move is reported with the status, or by a short message.
    explains_faults : bool
        Whether a fault is reported with its number and in words, or by a short message.
    forward_is_clockwise : bool
        Which of the two direction bits stands for counting up.
    """

    name: str
    serial_number: int
    hardware_type: int
    counts_per_deg: float
    velocity_word: float
    acceleration_word: float
    velocity_deg_s: float
    acceleration_deg_s2: float
    home_velocity_deg_s: float
    home_offset_deg: float = 4.0
    turn_limit: int = 43
    is_rack: bool = False
    is_servo: bool = False
    completes_empty_moves: bool = True
    completes_with_status: bool = True
    explains_faults: bool = True
    forward_is_clockwise: bool = False

    @property
    def step_deg(self) -> float:
        """One count."""
        return 1 / self.counts_per_deg

    @property
    def velocity_scale(self) -> float:
        """Velocity word of 1 deg/s."""
        return self.counts_per_deg * self.velocity_word

    @property
    def acceleration_scale(self) -> float:
        """Acceleration word of 1 deg/s²."""
        return self.counts_per_deg * self.acceleration_word


K10CR1 = AptModel(
    "K10CR1",
    serial_number=55000001,
    hardware_type=16,
    counts_per_deg=49_152_000 / 360,
    velocity_word=_STEPPER_VELOCITY,
    acceleration_word=_STEPPER_ACCELERATION,
    velocity_deg_s=10.0,
    acceleration_deg_s2=10.0,
    home_velocity_deg_s=10.0,
    completes_empty_moves=False,
)
BSC200_HDR50 = AptModel(
    "BSC20",
    serial_number=40000001,
    hardware_type=45,
    counts_per_deg=75091.0,
    velocity_word=_STEPPER_VELOCITY,
    acceleration_word=_STEPPER_ACCELERATION,
    velocity_deg_s=50.0,
    acceleration_deg_s2=80.0,
    home_velocity_deg_s=10.0,
    is_rack=True,
)
KDC101_PRM1Z8 = AptModel(
    "KDC101",
    serial_number=27000001,
    hardware_type=16,
    counts_per_deg=1919.6419,
    velocity_word=_DC_S * _SPEED_STEPS,
    acceleration_word=_DC_S**2 * _SPEED_STEPS,
    velocity_deg_s=25.0,
    acceleration_deg_s2=25.0,
    home_velocity_deg_s=10.0,
    is_servo=True,
    forward_is_clockwise=True,
)
KBD101_DDR100 = AptModel(
    "KBD101",
    serial_number=28000001,
    hardware_type=16,
    counts_per_deg=9102.22,
    velocity_word=_BRUSHLESS_S * _SPEED_STEPS,
    acceleration_word=_BRUSHLESS_S**2 * _SPEED_STEPS,
    velocity_deg_s=180.0,
    acceleration_deg_s2=180.0,
    home_velocity_deg_s=45.0,
    is_servo=True,
    forward_is_clockwise=True,
)
KBD101_DDR25 = replace(KBD101_DDR100, counts_per_deg=4000.0)

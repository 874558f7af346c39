"""Rotation stages on Thorlabs APT controllers: K10CR1, BSC20x with HDR50, KDC101 with PRM1Z8."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.clock import Deadline
from drivers.home_offset import HomeOffset
from drivers.same_device import same_device
from drivers.thorlabs_apt.channel import AptChannel
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.stage_models import APT_STAGES
from drivers.thorlabs_apt.status import AptStatus
from goniometer.errors import DeviceFaultError, LimitError

_FARTHEST_COUNTS = 2**31 - 1
_AT_TARGET_DEG = 0.02
_BEGIN_S = 1.0  # a stage that stands still for so long, away from its target, will not move any more
_ALIKE = 0.01  # controllers round the speed they are told


@dataclass
class _Motion:
    """A motion under way; homing has no target."""

    text: str
    target_counts: int | None
    was_homed: bool
    rest: Deadline
    has_moved: bool = False


class ThorlabsApt:
    """One stage on a controller of its own, or on a bay of a rack.

    Parameters
    ----------
    port : AptPort
        The port, which the bays of a rack share.
    stage : str
        The stage's model: one of `APT_STAGES`.
    name : str
        The axis' name in the rig file.
    velocity_deg_s, acceleration_deg_s2 : float
        Speed and acceleration of every move.
    bay : int or None
        The bay of a BSC20x, from 1; None for a controller of its own.
    home_offset_deg : float or None
        The home offset that the controller must have; None for whichever it has.
    """

    reports_in_motion = True

    def __init__(
        self,
        port: AptPort,
        stage: str,
        *,
        name: str,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        bay: int | None = None,
        home_offset_deg: float | None = None,
    ) -> None:
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._stage, self._clock, self._bay = APT_STAGES[stage], port.clock, bay
        self._channel = AptChannel(port, name, bay=bay, has_dc_motor=self._stage.has_dc_motor)
        self._home_offset = HomeOffset(name, home_offset_deg)
        self._motion: _Motion | None = None
        self.identity = ""

    def connect(self) -> tuple[str, ...]:
        """Check the controller, switch its channel on, and set velocity and acceleration; moves nothing.

        Play is the axis' affair (`drivers.axis`), which knows what may be in the way: the controller's own correction
        of backlash, which goes below the target, is switched off.

        Returns
        -------
        tuple of str
            The faults that the controller reports already, and its home offset.

        Raises
        ------
        DeviceFaultError
            When it is another controller, also than the last time, the bay is empty, a setting was not taken, or the
            home offset is another.
        """
        not_done, in_rig_file = "the stage was not set up", "check the port, the stage and the bay in the rig file"
        model, serial_number = self._channel.identity()
        if model not in self._stage.controllers:
            expected = " or ".join(self._stage.controllers)
            raise self._fault(f"the controller is a {model!r}, not a {expected}", not_done, in_rig_file)
        self.identity = same_device(self.name, self.identity, f"{model} {serial_number}")
        if not self._channel.is_present():
            raise self._fault(f"bay {self._bay} of the {model} is empty", not_done, in_rig_file)
        if not self._channel.enable():
            raise self._fault("the channel stays off", not_done, "look at the controller's panel and its interlock")
        wanted = self.velocity_deg_s, self.acceleration_deg_s2
        taken = self._stage.speeds(self._channel.set_velocity(self._stage.words(*wanted)))
        if any(abs(has - should) > _ALIKE * should for has, should in zip(taken, wanted, strict=True)):
            raise self._fault(
                f"the controller moves at {taken[0]:.4g} degrees/s and {taken[1]:.4g} degrees/s², not at "
                f"{wanted[0]:g} and {wanted[1]:g} as it was told",
                not_done,
                "set velocity_deg_s and acceleration_deg_s2 in the rig file to what the stage can do",
            )
        if backlash := self._channel.set_backlash(0):
            raise self._fault(
                f"the controller keeps a backlash correction of {self._degrees(backlash):g} degrees, by which it would "
                "go below every target",
                not_done,
                "set its backlash to 0 with the maker's software, and backlash_deg in the rig file to what the gear "
                "needs",
            )
        notes = self._home_offset.check(self._degrees(self._channel.home_offset()))
        return self._channel.status().faults + self._channel.take_reports() + notes

    def is_homed(self) -> bool:
        """Whether the controller says that its stage was homed since it was switched on."""
        return self._channel.status().is_homed

    def start_homing(self) -> None:
        """Begin to search the home position; raises DeviceFaultError when the controller has a fault."""
        self._begin("the homing", target_counts=None)
        self._channel.start_homing()

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`.

        Raises
        ------
        LimitError
            When the target has more counts than a message holds; nothing is sent.
        DeviceFaultError
            When the controller has a fault or its channel is off.
        """
        target_counts = round(target_deg * self._stage.counts_per_deg)
        if abs(target_counts) > _FARTHEST_COUNTS:
            raise LimitError(
                self.name,
                f"the target {target_deg:g} degrees is more than the {self._degrees(_FARTHEST_COUNTS):.0f} degrees "
                "that the controller can count",
                not_done="the move was refused and nothing was sent",
                to_do="home the stage, and choose angles nearer to its zero",
            )
        self._begin(f"the move to {target_deg:g} degrees", target_counts)
        self._channel.start_move(target_counts)

    def is_moving(self) -> bool:
        """Ask whether the motion goes on.

        The end is told by the status alone: the message that a motion has ended is not always sent.

        Raises
        ------
        DeviceFaultError
            When the controller reports a fault, has lost its home position or its power, did not begin to move, or
            stopped at a limit.
        """
        motion = self._motion
        status = self._checked_status(motion)
        if status.is_moving:
            if motion is not None:
                motion.has_moved, motion.rest = True, self._begun()
            return True
        if motion is None or self._has_arrived(status, motion):
            return False
        if not motion.rest.has_passed():
            return True
        if motion.target_counts is None and status.is_homed and self._is_near(status, 0):
            return False  # it stood there already
        if status.limits or motion.target_counts is None or not motion.has_moved:
            raise self._fault(
                f"the stage stands still at {self._degrees(status.counts):g} degrees"
                + (f", at {status.limits}" if status.limits else ", and the controller says nothing of a reason"),
                motion.text,
                "look what the stage has met, check its plug and the controller's panel, and compare limits_deg and "
                "zero_deg in the rig file with the stage",
            )
        return False

    def position_deg(self) -> float:
        """Where the controller counts the stage to be."""
        return self._degrees(self._channel.status().counts)

    def stop(self) -> None:
        """Stop with the set deceleration; returns when a question asked after the stop was answered."""
        self._motion = None
        self._channel.stop()
        self._channel.status()

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._channel.reconnect()

    def close(self) -> None:
        """Close the port; the motor stays powered and holds its position."""
        self._channel.close()

    def _begin(self, text: str, target_counts: int | None) -> None:
        motion = _Motion(text, target_counts, was_homed=False, rest=self._begun())
        motion.was_homed = self._checked_status(motion).is_homed and target_counts is not None
        motion.rest = self._begun()
        self._motion = motion

    def _begun(self) -> Deadline:
        return Deadline(self._clock, _BEGIN_S)

    def _has_arrived(self, status: AptStatus, motion: _Motion) -> bool:
        if motion.target_counts is None:
            return status.is_homed and motion.has_moved
        return self._is_near(status, motion.target_counts)

    def _is_near(self, status: AptStatus, counts: int) -> bool:
        return abs(status.counts - counts) <= _AT_TARGET_DEG * self._stage.counts_per_deg

    def _checked_status(self, motion: _Motion | None) -> AptStatus:
        status = self._channel.status()
        not_done = "the motion" if motion is None else motion.text
        faults = status.faults + self._channel.take_reports()
        if faults:
            raise self._fault(
                f"the controller reports {' and '.join(faults)}",
                not_done,
                "look at the stage and its cable, switch the controller off and on, and home it",
            )
        if motion is not None and motion.was_homed and not status.is_homed:
            raise self._fault(
                "the controller has lost its home position: it was switched off or reset",
                not_done,
                "check its power supply, then connect and home it again",
            )
        if not status.is_enabled:
            raise self._fault(
                "the channel is off and the motor without power",
                not_done,
                "switch the channel on at the controller's panel or connect again, then home the stage",
            )
        return status

    def _degrees(self, counts: int) -> float:
        return counts / self._stage.counts_per_deg

    def _fault(self, happened: str, not_done: str, to_do: str) -> DeviceFaultError:
        return DeviceFaultError(self.name, happened, not_done=not_done, to_do=to_do)

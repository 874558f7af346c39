"""Newport ESP300 and ESP301 motion controllers: up to three axes, text lines, errors kept in a queue."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.clock import Clock
from drivers.newport_esp301.errors import ControllerError, parse_error
from drivers.same_device import same_device
from drivers.wire.line_dialogue import LineDialogue
from drivers.wire.link import Link
from drivers.wire.reply_text import number, switch, unusable, whole_number
from goniometer.errors import DeviceFaultError, ReplyTimeoutError

T = TypeVar("T")

_UNIT_DEGREES = 7
_NO_OPERATION = "WT0"  # wait for 0 ms; begins with a letter, so no number that was sent in part grows by it
_ERROR_QUEUE_DEPTH = 10
_LINE_PAUSE_S = 0.01  # the controller wants some 10 ms between lines when the first of them has no answer


class NewportEsp301:
    """The controller; its axes are made by `axis`.

    Parameters
    ----------
    link : Link
        19200 baud with RTS/CTS on RS-232.
    clock : Clock
        Counts the deadlines of motions.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.clock = clock
        self._link = link
        self._names: dict[int, str] = {}
        self._dialogue = LineDialogue(
            link,
            identity_question="VE?",
            identity="ESP30",
            command_end=b"\r",
            answer_end=b"\r\n",
            end_cut_command=lambda: self.send(_NO_OPERATION),
        )

    def connect(self) -> tuple[str, ...]:
        """Check that an ESP300 or ESP301 answers, and empty its error queue; moves nothing.

        Returns
        -------
        tuple of str
            The errors that were still in the queue from earlier use, oldest first.
        """
        self._dialogue.begin()
        return tuple(str(error) for error in self._pop_errors())

    def stage(self, number: int, *, name: str, velocity_deg_s: float, acceleration_deg_s2: float) -> Esp301Stage:
        """Return the stage at the connector with this number; nothing is sent before its `connect`."""
        self._names[number] = name
        return Esp301Stage(self, number, name, velocity_deg_s, acceleration_deg_s2)

    def send(self, command: str) -> None:
        """Send a command that has no answer."""
        self._dialogue.tell(command)
        self.clock.sleep(_LINE_PAUSE_S)

    def query(self, question: str, read: Callable[[str], T], *, safe_to_repeat: bool) -> T:
        """Send a question and return what `read` makes of the line that answers it."""
        return self._dialogue.query(question, read, safe_to_repeat=safe_to_repeat)

    def stop(self, number: int) -> None:
        """Stop one axis, whatever was sent before."""
        self.send(_NO_OPERATION)  # what was sent in part before must not swallow the stop
        self.send(f"{number}ST")

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._link.reconnect()
        self._dialogue.begin()

    def raise_errors(self, not_done: str, *, aborted: int | None = None) -> None:
        """Empty the error queue and raise DeviceFaultError, in the name of the axis at fault, if it held anything.

        Of the axis `aborted`, whose search for home was stopped on purpose, that it was aborted is no error.
        """
        errors = [error for error in self._pop_errors() if not (error.is_homing_aborted and error.axis == aborted)]
        if errors:
            names = [self._names[error.axis] for error in errors if error.axis in self._names]
            raise DeviceFaultError(
                names[0] if names else self._link.device,
                f"the controller reports {'; '.join(map(str, errors))}",
                not_done=not_done,
                to_do="look at the stage, its cable, its limit switches and the emergency stop, then start again",
            )

    def close(self) -> None:
        """Close the port; motors stay powered and hold their positions."""
        self._link.close()

    def _pop_errors(self) -> list[ControllerError]:
        errors: list[ControllerError] = []
        while (error := self._next_error()) is not None:
            errors.append(error)
            if len(errors) > _ERROR_QUEUE_DEPTH:
                raise unusable(self._link.device, "TB?", str(error), "the end of a queue of ten errors")
        return errors

    def _next_error(self) -> ControllerError | None:
        # the question takes the error out of the queue: asked again, it would lose one
        return self.query("TB?", lambda line: parse_error(self._link.device, line), safe_to_repeat=False)


class Esp301Stage:
    """One stage of the controller. Whether it was homed the controller does not say: it is taken to be."""

    reports_in_motion = True

    def __init__(
        self,
        controller: NewportEsp301,
        number: int,
        name: str,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
    ) -> None:
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._controller = controller
        self._number = number
        self._under_way = ""
        self._is_stopped = False
        self.identity = ""
        self.stood_s = 0.0

    def connect(self) -> tuple[str, ...]:
        """Check the stage and its unit, set velocity and acceleration, switch the motor on; moves nothing.

        Raises
        ------
        DeviceFaultError
            When there is no stage, its unit is not the degree, or the controller refuses a setting; when it is called
            again, also for another stage, and for a motor that is off: its controller was reset and counts from where
            it stands.
        """
        try:
            model = self._query("ID?", _stage_model)
        except ReplyTimeoutError:
            self._controller.raise_errors(not_done="the axis was not set up")  # says so if there is no such axis
            raise
        if not model:
            raise DeviceFaultError(
                self.name,
                f"there is no stage at axis {self._number} of the controller",
                not_done="nothing was set and nothing was moved",
                to_do="check the stage's plug and the axis number in the rig file",
            )
        unit = self._query("SN?", whole_number)
        if unit != _UNIT_DEGREES:
            raise DeviceFaultError(
                self.name,
                f"axis {self._number} of the controller counts in unit {unit}, not in degrees (unit {_UNIT_DEGREES})",
                not_done="nothing was set and nothing was moved",
                to_do="check the axis number in the rig file, or set the unit in the controller",
            )
        if self.identity:
            self._require_power(not_done="the axis was not set up again")
        self.identity = same_device(self.name, self.identity, model)
        self._send(f"VA{self.velocity_deg_s:.6f}")
        self._send(f"AC{self.acceleration_deg_s2:.6f}")
        self._send(f"AG{self.acceleration_deg_s2:.6f}")
        self._send("MO")
        self._controller.raise_errors(not_done="the axis was not set up")
        self._require_power(not_done="the axis was not set up")
        return ()

    def is_homed(self) -> bool:
        """Whether the stage knows its zero, as far as the controller can tell: always."""
        return True

    def start_homing(self) -> None:
        """Begin to search home in the controller's own way (OM)."""
        self._under_way, self._is_stopped = f"the search of {self.name} for its home position", False
        self._send("OR")
        self._controller.raise_errors(self._under_way)

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`; raises DeviceFaultError when the controller refuses."""
        self._under_way, self._is_stopped = f"the move of {self.name} to {target_deg:g} degrees", False
        self._send("PA" + f"{target_deg:.6f}".rstrip("0").rstrip("."))
        self._controller.raise_errors(self._under_way)

    def is_moving(self) -> bool:
        """Ask whether the motion goes on; raises DeviceFaultError when it has failed or the motor has lost power."""
        if not self._query("MD?", switch):
            return True
        self.stood_s = self._controller.clock.now()
        not_done, self._under_way = self._under_way, ""
        self._controller.raise_errors(
            not_done or "what was to follow", aborted=self._number if self._is_stopped else None
        )
        if not_done:
            # a controller that was reset says that motion is done, and starts to count at 0 where it stands
            self._require_power(not_done)
        return False

    def position_deg(self) -> float:
        """Where the encoder says the axis is."""
        return self._query("TP?", number)

    def stop(self) -> None:
        """Stop with the set deceleration; safe at any time, also when an exchange was interrupted: it has no answer."""
        self._controller.stop(self._number)
        self._is_stopped = True

    def reconnect(self) -> None:
        """Open the port of the controller, and so of all its axes, afresh."""
        self._controller.reconnect()

    def close(self) -> None:
        """Close the port of the controller, and so of all its axes; motors stay powered and hold their positions."""
        self._controller.close()

    def _require_power(self, not_done: str) -> None:
        if not self._query("MO?", switch):
            raise DeviceFaultError(
                self.name,
                "the motor is off: its controller was reset, or the emergency stop is pressed",
                not_done=not_done,
                to_do=f"release the emergency stop, look at the amplifier, then home the axis {self.name} before the "
                "next scan",
            )

    def _send(self, command: str) -> None:
        self._controller.send(f"{self._number}{command}")

    def _query(self, question: str, read: Callable[[str, str, str], T]) -> T:
        question = f"{self._number}{question}"
        return self._controller.query(question, lambda answer: read(self.name, question, answer), safe_to_repeat=True)


def _stage_model(device: str, question: str, answer: str) -> str:
    """Read ``URS100CC, SN1234``: model and serial number; empty when there is no stage."""
    model, comma, _ = answer.partition(",")
    if answer and not comma:
        raise unusable(device, question, answer, "a stage's model and serial number")
    return answer if model.strip() else ""

"""One packet to a Thorlabs Elliptec module and what answers it."""

from __future__ import annotations

from drivers.clock import Clock, Deadline
from drivers.thorlabs_elliptec.packets import BUSY, Packet, command, status_text
from goniometer.errors import DeviceError, DeviceFaultError, ReplyError, ReplyTimeoutError

PROOFS = {"in": "IN", "i1": "I1"}
"""Questions whose answer cannot be mistaken for that of any other, with its kind."""

_MOTIONS = ("ho", "ma", "fw", "bw")
_ANSWERS = {
    **{letters: (kind,) for letters, kind in PROOFS.items()},
    **dict.fromkeys((*_MOTIONS, "st"), ("PO", "GS")),
    **dict.fromkeys(("gs", "sv", "sj"), ("GS",)),
    "gp": ("PO",),
    "gv": ("GV",),
    "gj": ("GJ",),
    "go": ("HO",),
}
_ANY_STATUS = ("gs", "st")  # whatever the status, it is what was asked for, or shows that the stop has got through
_REPLY_S = 1.0
_MOTION_S = 4.0  # a module drives its motor for 2 s at most


class Exchange:
    """A packet that waits, was sent, was answered, or was given up.

    Parameters
    ----------
    device : str
        Name of the module, for messages.
    address : int
        The module on the bus, 0 to 15.
    letters, data : str
        The command.
    """

    def __init__(self, device: str, address: int, letters: str, data: str = "") -> None:
        self.device, self.address, self.letters = device, address, letters
        self.packet = command(address, letters, data)
        self._answer: Packet | None = None
        self._error: DeviceError | None = None
        self._deadline: Deadline | None = None

    @property
    def is_motion(self) -> bool:
        """Whether it is answered only when the module has arrived."""
        return self.letters in _MOTIONS

    @property
    def is_proof(self) -> bool:
        """Whether its answer cannot be mistaken, so that answers before it may be dropped."""
        return self.letters in PROOFS

    @property
    def is_over(self) -> bool:
        """Whether it was answered or given up."""
        return self._answer is not None or self._error is not None

    def answer(self) -> Packet:
        """Return the answer; raises what the exchange failed with."""
        if self._error is not None:
            raise self._error
        if self._answer is None:
            raise RuntimeError("the exchange is not over")
        return self._answer

    def begin(self, clock: Clock) -> None:
        """Note that the packet was sent."""
        self._deadline = Deadline(clock, _MOTION_S if self.is_motion else _REPLY_S)

    def fail(self, error: DeviceError) -> None:
        """Give the exchange up."""
        self._error = error

    def take(self, packet: Packet) -> None:
        """Take a packet from the module; what it means is seen from `is_over` and `answer`.

        A busy module has not finished: its answer is still to come. Before a proof come answers to earlier packets.
        """
        status = packet.unsigned if packet.kind == "GS" else 0
        if self.is_motion and status == BUSY:
            return
        if packet.kind == "GS" and status and self.letters not in _ANY_STATUS and not self.is_proof:
            self._error = DeviceFaultError(
                self.device,
                f"the module answers {self._text} with status {status}, {status_text(status)}",
                not_done="the command was not carried out, or not to its end",
                to_do="look whether the mount turns freely and the module has its 5 V, then home it",
            )
        elif packet.kind in _ANSWERS[self.letters]:
            self._answer = packet
        elif not self.is_proof:
            self.refuse(f"{packet.kind}{packet.data}")

    def refuse(self, line: str) -> None:
        """Take a line that cannot be the answer; a proof waits on."""
        if not self.is_proof:
            self._error = ReplyError(
                self.device,
                f"the answer to {self._text} is {line!r}, which is not {' or '.join(_ANSWERS[self.letters])}",
                not_done="the answer was not used",
                to_do="check that the port in the rig file belongs to the bus; if it happens now and then, look for a "
                "loose cable, or for two modules with one address",
            )

    def check_time(self) -> None:
        """Give up when the answer is overdue."""
        if self._deadline is not None and self._deadline.has_passed():
            self.time_out()

    def time_out(self) -> None:
        """Give up: no answer has come."""
        self._error = ReplyTimeoutError(
            self.device,
            f"no answer to {self._text} from the module with address {self.address:X}",
            not_done="the command may have been carried out, in part or not at all"
            if self.is_motion
            else "the exchange was given up",
            to_do="check the module's power and cable, and its address in the rig file",
        )

    @property
    def _text(self) -> str:
        return repr(self.packet.decode("ascii"))

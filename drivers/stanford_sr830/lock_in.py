"""What an SR830 can be asked and told, one line each."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Flag

from drivers.wire.line_dialogue import LineDialogue
from drivers.wire.link import Link
from drivers.wire.reply_text import number, unusable, whole_number

LEAST_SENSITIVE = 26
TIME_CONSTANTS_S = tuple(float(f"{digit}e{power}") for power in range(-5, 5) for digit in (1, 3))
"""10 us, 30 us, 100 us ... 30 ks."""

SLOPES_DB = (6, 12, 18, 24)
# Until all but 1e-4 of a step has passed, for each slope: exp(-n) (1 + n + n^2/2 ...) with as many terms as there are
# stages. To 99 % it takes 5 to 10, but then the light of the last slot would be seen in every reading.
_SETTLING_TIME_CONSTANTS = (9.3, 11.8, 14.0, 16.0)
_EXTERNAL, _INTERNAL = 0, 1
_ANSWERS_TO_SERIAL_PORT = "OUTX 0"
_SAMPLE = "SNAP? 3,4,9"


@dataclass(frozen=True)
class Sample:
    """One simultaneous reading: magnitude in volts (rms), phase in degrees, reference frequency in hertz."""

    magnitude_v: float
    phase_deg: float
    reference_hz: float


@dataclass(frozen=True)
class Settings:
    """What readings hang on.

    Parameters
    ----------
    time_constant_s : float
        Of the low-pass filter behind the demodulator: one of `TIME_CONSTANTS_S`.
    slope_db : int
        Its slope, in dB an octave: one of `SLOPES_DB`.
    follows_chopper : bool
        Whether the reference is the external one.
    """

    time_constant_s: float
    slope_db: int
    follows_chopper: bool = True

    def __str__(self) -> str:
        reference = "external" if self.follows_chopper else "internal"
        return f"time constant {self.time_constant_s:g} s, slope {self.slope_db} dB, {reference} reference"

    @property
    def settling_s(self) -> float:
        """How long the output takes to follow the light, to 1e-4 of a step."""
        return _SETTLING_TIME_CONSTANTS[SLOPES_DB.index(self.slope_db)] * self.time_constant_s


class Condition(Flag):
    """What has happened since the lock-in was last asked."""

    INPUT_OVERLOAD = 1
    FILTER_OVERLOAD = 2
    OUTPUT_OVERLOAD = 4
    UNLOCKED = 8
    RANGE_CHANGED = 16
    TIME_CONSTANT_CHANGED = 32
    TRIGGERED = 64


def parse_sample(device: str, answer: str) -> Sample:
    """Read an answer to ``SNAP? 3,4,9`` such as ``0.00103,12.5,317.2``; raises ReplyError otherwise."""
    fields = answer.split(",")
    if len(fields) != 3:
        raise unusable(device, _SAMPLE, answer, "three numbers with commas between")
    return Sample(*(number(device, _SAMPLE, field.strip()) for field in fields))


def parse_condition(device: str, answer: str) -> Condition:
    """Read an answer to ``LIAS?``, a byte of flags; raises ReplyError otherwise."""
    flags = whole_number(device, "LIAS?", answer)
    if not 0 <= flags <= 0xFF:
        raise unusable(device, "LIAS?", answer, "a whole number from 0 to 255")
    return Condition(flags & 0x7F)


class Sr830LockIn:
    """A lock-in amplifier SR830 or SR810 on RS-232.

    Parameters
    ----------
    link : Link
        The serial port, without handshake.
    name : str
        The device's name in the rig file.
    """

    def __init__(self, link: Link, *, name: str) -> None:
        self._name = name
        self._dialogue = LineDialogue(
            link,
            identity_question="*IDN?",
            identity="STANFORD_RESEARCH_SYSTEMS,SR8",
            command_end=b"\r",
            answer_end=b"\r",
            end_cut_command=lambda: self._dialogue.tell(_ANSWERS_TO_SERIAL_PORT),
        )

    def begin(self) -> None:
        """Have the answers sent to this port, and the identity proven before the next question."""
        self._dialogue.begin()

    def settings(self) -> Settings:
        """Ask for the output filter and the reference."""
        return Settings(
            TIME_CONSTANTS_S[self._index("OFLT?", len(TIME_CONSTANTS_S) - 1)],
            SLOPES_DB[self._index("OFSL?", len(SLOPES_DB) - 1)],
            self._index("FMOD?", 1) == _EXTERNAL,
        )

    def set(self, wanted: Settings) -> None:
        """Set what differs; raises ReplyError when the lock-in holds something else afterwards."""
        held = self.settings()
        if held.time_constant_s != wanted.time_constant_s:
            self._dialogue.tell(f"OFLT {TIME_CONSTANTS_S.index(wanted.time_constant_s)}")
        if held.slope_db != wanted.slope_db:
            self._dialogue.tell(f"OFSL {SLOPES_DB.index(wanted.slope_db)}")
        if held.follows_chopper != wanted.follows_chopper:
            self._dialogue.tell(f"FMOD {_EXTERNAL if wanted.follows_chopper else _INTERNAL}")
        if held != wanted and (held := self.settings()) != wanted:
            raise unusable(self._name, "OFLT?, OFSL? and FMOD?", str(held), f"what was just set ({wanted})")

    def sensitivity(self) -> int:
        """Ask for the index of the full scale, 0 (2 nV) to 26 (1 V)."""
        return self._index("SENS?", LEAST_SENSITIVE)

    def set_sensitivity(self, index: int) -> None:
        """Set the full scale; raises ReplyError when the lock-in holds another one afterwards."""
        self._dialogue.tell(f"SENS {index}")
        held = self.sensitivity()
        if held != index:
            raise unusable(self._name, "SENS?", str(held), f"the sensitivity {index} just set")

    def condition(self) -> Condition:
        """Ask what has happened since the last question; what was told is forgotten by the lock-in."""
        return self._dialogue.query("LIAS?", lambda answer: parse_condition(self._name, answer))

    def sample(self) -> Sample:
        """Ask for magnitude, phase and reference frequency of one moment."""
        return self._dialogue.query(_SAMPLE, lambda answer: parse_sample(self._name, answer), safe_to_repeat=True)

    def _index(self, question: str, largest: int) -> int:
        def read(answer: str) -> int:
            index = whole_number(self._name, question, answer)
            if not 0 <= index <= largest:
                raise unusable(self._name, question, answer, f"a whole number from 0 to {largest}")
            return index

        return self._dialogue.query(question, read, safe_to_repeat=True)

"""Questions and answers in lines of text, for devices whose answers carry no sign of what was asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.wire.link import Link
from drivers.wire.reply_text import unusable
from goniometer.errors import ReplyError, ReplyTimeoutError

T = TypeVar("T")

_MOST_OLD_ANSWERS = 32


class LineDialogue:
    """One question at a time, and proof that an answer belongs to it.

    Answers come in order. Once an answer was given up, or was none, every later one might belong to the question
    before. Only the identity cannot be mistaken: before the next question it is asked for, and answers are trusted
    again when it has come as often as it was asked for, or when there is silence behind it.

    Parameters
    ----------
    link : Link
        The port.
    identity_question, identity : str
        A question and, in upper case, what only its answer contains.
    command_end, answer_end : bytes
        What ends a command and an answer.
    end_cut_command : callable
        Sends a harmless command without an answer. Behind a command that was sent in part it makes one that the device
        does not know; an end of line alone would carry out the part.
    """

    def __init__(
        self,
        link: Link,
        *,
        identity_question: str,
        identity: str,
        command_end: bytes,
        answer_end: bytes,
        end_cut_command: Callable[[], None],
    ) -> None:
        self._link = link
        self._identity_question, self._identity = identity_question, identity
        self._command_end, self._answer_end = command_end, answer_end
        self._end_cut_command = end_cut_command
        self._identities_to_come = 0
        self._in_step = True  # nothing was asked yet; `begin` has it proven
        link.on_reopen(self._forget)

    def begin(self) -> None:
        """Forget what was asked for and have it proven, before the next question, that answers belong to questions."""
        self._link.discard_input()
        self._forget()

    def identity(self) -> str:
        """What the device says of itself, with its serial number."""

        def read(line: str) -> str:
            if self._identity not in line.upper():
                raise self._no_identity(line)
            return line

        return self.query(self._identity_question, read, safe_to_repeat=True)

    def tell(self, command: str) -> None:
        """Send a command that has no answer."""
        self._link.write(command.encode("ascii") + self._command_end)

    def ask(self, question: str) -> None:
        """Send a question whose answer `poll` will return."""
        if not self._in_step or self._link.has_input():
            self._resynchronise()
        self._in_step = False
        self.tell(question)

    def is_answered(self) -> bool:
        """Whether `poll` will find a line; never waits."""
        return self._link.has_frame(self._answer_end)

    def poll(self, read: Callable[[str], T]) -> T | None:
        """Return what `read` makes of the answer if it has come, else None; never waits."""
        frame = self._link.poll_until(self._answer_end)
        return None if frame is None else self._accept(frame, read)

    def query(self, question: str, read: Callable[[str], T], *, safe_to_repeat: bool = False) -> T:
        """Send a question and return what `read` makes of its answer; an answer that `read` refuses is not trusted.

        A question whose answer stays the same until something else happens is safe to repeat when its answer was lost;
        one whose answer is gone once it was sent, such as the next error of a queue, is not.
        """
        if safe_to_repeat:
            return self._link.until_answered(lambda: self.query(question, read))
        self.ask(question)
        return self._accept(self._link.read_until(self._answer_end), read)

    def _accept(self, frame: bytes, read: Callable[[str], T]) -> T:
        value = read(_text(frame))
        self._in_step = True
        return value

    def _forget(self) -> None:
        self._identities_to_come = 0
        self._in_step = False

    def _resynchronise(self) -> None:
        self._in_step = False
        self._end_cut_command()
        self.tell(self._identity_question)
        self._identities_to_come += 1
        line, seen = "", False
        for _ in range(_MOST_OLD_ANSWERS + self._identities_to_come):
            try:
                line = _text(self._link.read_until(self._answer_end))
            except ReplyTimeoutError:
                if not seen:
                    raise
                # silence behind an identity: those that are missing were lost. One that comes after all is found before
                # the next question, or is no answer to it.
                self._identities_to_come = 0
            else:
                is_identity = self._identity in line.upper()
                seen |= is_identity
                self._identities_to_come -= is_identity
            if not self._identities_to_come:
                self._in_step = True
                return
        raise self._no_identity(line)

    def _no_identity(self, line: str) -> ReplyError:
        expected = f"an identity with {self._identity} in it"
        return unusable(self._link.device, self._identity_question, line, expected)


def _text(frame: bytes) -> str:
    return frame.decode("ascii", errors="replace").strip()

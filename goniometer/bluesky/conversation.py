"""Whether the program that gives orders has another one now: in virtual time nothing may pass before it has.

Real time passes anyhow. Virtual time passes as fast as the bench can count, and one arm would have arrived before the
RunEngine came to say where the other one should go at the same time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

_TURNS = 10
"""Turns of an event loop without an order, after which it waits: the RunEngine needs some five between two orders."""


class Conversation:
    """Listens to the event loop from which orders come; a program without one gives an order and waits.

    Parameters
    ----------
    post : callable
        Has something done in the bench's thread; called in the loop's.

    Attributes
    ----------
    goes_on : bool
        Whether another order may come at this moment.
    """

    def __init__(self, post: Callable[[Callable[[], None]], None]) -> None:
        self.goes_on = False
        self._post = post
        self._loop: asyncio.AbstractEventLoop | None = None
        self._said = 0

    def hear(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take note of an order from a loop."""
        self._loop = loop
        self.hear_out()

    def hear_out(self) -> None:
        """Go on until the loop has nothing more to say: it has just said something, or was told something."""
        if self._loop is None:
            return
        self._said += 1
        try:
            self._loop.call_soon_threadsafe(self._turn, self._said, _TURNS)
        except RuntimeError:  # the loop is closed: nobody is there any more
            self.goes_on = False
        else:
            self.goes_on = True

    def _turn(self, said: int, turns_left: int) -> None:
        if turns_left:
            asyncio.get_running_loop().call_soon(self._turn, said, turns_left - 1)
        else:
            self._post(lambda: self._fall_silent(said))

    def _fall_silent(self, said: int) -> None:
        if said == self._said:
            self.goes_on = False

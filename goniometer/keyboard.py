"""Single keys that control a scan: p or space, s, q, + and -."""

from __future__ import annotations

import os
import re
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from acquisition.control import ScanControl

HELP = "p pause, go on · s skip direction · + - exposure · q end"

_SPECIAL = re.compile(r"\x1b(\[[0-9;]*.|O.|)")
"""What arrow and function keys send; some end in a letter that stands for an order."""

_LOOK_S = 0.2
"""How often it is seen whether the scan has ended, or the terminal belongs to another program."""

_restore: list[tuple[int, list[Any]]] = []
"""How to set the terminal back, while it is not as it was found."""


def plain_keys(pressed: bytes) -> str:
    """The keys in what a terminal sent, without arrow and function keys."""
    return _SPECIAL.sub("", pressed.decode("ascii", "replace"))


def press(key: str, control: ScanControl) -> None:
    """Do what a key stands for; nothing for a key that stands for nothing."""
    match key:
        case "p" | "P" | " ":
            if control.is_paused:
                control.go_on()
            else:
                control.pause()
        case "s" | "S":
            control.skip()
        case "+" | "=":
            control.scale_exposure(2.0)
        case "-" | "_":
            control.scale_exposure(0.5)
        case "g" | "G":
            control.go_on()
        case "q" | "Q":
            control.abort("the key q")


if sys.platform == "win32":
    import msvcrt

    @contextmanager
    def keys(control: ScanControl, stream: TextIO | None) -> Iterator[str]:
        """Let keys control a scan while the block runs; yields what to tell a person of them, empty without any."""
        if stream is None or not stream.isatty():
            yield ""
            return
        ended = threading.Event()

        def listen() -> None:
            while not ended.wait(_LOOK_S):
                while msvcrt.kbhit():
                    press(msvcrt.getwch(), control)

        with _listening(listen, ended):
            yield HELP

    def restore_terminal() -> None:
        """Do nothing: here a terminal is never set otherwise."""

else:
    import signal
    import termios

    @contextmanager
    def keys(control: ScanControl, stream: TextIO | None) -> Iterator[str]:
        """Let keys control a scan while the block runs; yields what to tell a person of them, empty if there are none.

        There are none when the stream is no terminal, or this program runs in the background of one. The terminal still
        turns Ctrl-C and Ctrl-Z into signals; it is as it was before when the block ends, however it ends.
        """
        descriptor = _terminal(stream)
        if descriptor is None:
            yield ""
            return
        _set_to_single_keys(descriptor)
        ended = threading.Event()

        def listen() -> None:
            while not ended.is_set():
                if not _is_in_foreground(descriptor):
                    ended.wait(_LOOK_S)  # reading would stop this program
                elif select.select([descriptor], [], [], _LOOK_S)[0] and _is_in_foreground(descriptor):
                    pressed = os.read(descriptor, 64)
                    if not pressed:
                        return  # the terminal is gone
                    for key in plain_keys(pressed):
                        press(key, control)

        before = signal.getsignal(signal.SIGCONT) if threading.current_thread() is threading.main_thread() else None
        if before is not None:
            signal.signal(signal.SIGCONT, lambda number, frame: _set_to_single_keys(descriptor))
        try:
            with _listening(listen, ended):
                yield HELP
        finally:
            if before is not None:
                signal.signal(signal.SIGCONT, before)
            restore_terminal()

    def restore_terminal() -> None:
        """Set the terminal back to how it was found, if it is not; from any thread."""
        while _restore:
            descriptor, attributes = _restore.pop()
            if _is_in_foreground(descriptor):  # else the shell has done so, and doing it would stop this program
                try:
                    termios.tcsetattr(descriptor, termios.TCSADRAIN, attributes)
                except (OSError, termios.error):
                    return  # the terminal is gone

    def _terminal(stream: TextIO | None) -> int | None:
        try:
            if stream is None or not stream.isatty() or not _is_in_foreground(stream.fileno()):
                return None
            return stream.fileno()
        except (OSError, ValueError):  # closed, or no file
            return None

    def _set_to_single_keys(descriptor: int) -> None:
        if not _is_in_foreground(descriptor):
            return
        try:
            found = termios.tcgetattr(descriptor)
            if not _restore:
                _restore.append((descriptor, found))
            single = [*found[:3], found[3] & ~(termios.ICANON | termios.ECHO), *found[4:]]
            single[6] = [*found[6]]
            single[6][termios.VMIN], single[6][termios.VTIME] = 1, 0
            termios.tcsetattr(descriptor, termios.TCSADRAIN, single)
        except (OSError, termios.error):
            return  # the terminal is gone: there are no keys

    def _is_in_foreground(descriptor: int) -> bool:
        try:
            return os.tcgetpgrp(descriptor) == os.getpgrp()
        except OSError:
            return False


@contextmanager
def _listening(listen: Callable[[], None], ended: threading.Event) -> Iterator[None]:
    thread = threading.Thread(target=listen, name="keyboard", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()

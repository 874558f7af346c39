"""What is done for a program that hangs: it says where, another process stops the bench, and it ends."""

from __future__ import annotations

import faulthandler
import os
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

from goniometer.keyboard import restore_terminal

HUNG = 4
"""Exit code of a program that hung."""


def end_hung(silent_s: float, folder: Path, rig_path: Path | None) -> NoReturn:
    """End this program at once, from whichever thread, and have its bench stopped.

    The links belong to the thread that hangs and cannot be used from here: bytes of two threads would mix, and nobody
    knows what was sent in part. So the system closes the ports with the program, and `goniometer stop` opens them
    afresh.

    Parameters
    ----------
    silent_s : float
        How long the scan has not gone on.
    folder : Path
        The run's folder.
    rig_path : Path or None
        The bench to stop; None for one that this process simulates, which ends with it.
    """
    restore_terminal()
    bench = "The simulated bench ends with it." if rig_path is None else f"Stopping the bench of {rig_path}:"
    print(
        f"The scan has not gone on for {silent_s:.0f} s: the program hangs, where the lines below say. It is ended "
        f"with exit code {HUNG}. Every reading shown is stored in {folder}. {bench}",
        file=sys.stderr,
        flush=True,
    )
    try:
        faulthandler.dump_traceback(sys.__stderr__ or sys.stderr)
    except (OSError, ValueError, AttributeError):
        print("Where it hangs cannot be shown here.", file=sys.stderr, flush=True)
    try:
        if rig_path is not None:
            command = [sys.executable, "-m", "goniometer", "stop", "--rig", str(rig_path.resolve())]
            subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)  # noqa: S603 (ours)
    except OSError as error:
        print(f"The bench could NOT be stopped ({error}). Cut its power if it moves.", file=sys.stderr, flush=True)
    finally:
        os._exit(HUNG)

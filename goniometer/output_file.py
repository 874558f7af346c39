"""Where a command may write: never over what it reads."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from goniometer.errors import ConfigurationError


def require_output(path: Path, suffixes: tuple[str, ...], inputs: Iterable[Path]) -> None:
    """Refuse a file that is of another kind than what will be written, or an input.

    Parameters
    ----------
    path : Path
        The file to write.
    suffixes : tuple of str
        How its name may end, in small letters, with the dot.
    inputs : iterable of Path
        What the command reads: files, or runs' folders, whose own files are inputs too.

    Raises
    ------
    ConfigurationError
        If the file must not be written; nothing was.
    """
    if path.suffix.lower() not in suffixes:
        raise ConfigurationError([f"{path} would be a {' or '.join(suffixes)} file: give it such a name."])
    target = path.resolve()
    for read in inputs:
        source = read.resolve()
        if target == source or (source.is_dir() and target.parent == source and target.exists()):
            raise ConfigurationError(
                [f"{path} is what is read, and would be lost. Nothing was done. Choose another name."]
            )

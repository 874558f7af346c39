"""Where a run comes from: who ran what, when, where, with which versions, and from which state of which source."""

from __future__ import annotations

import getpass
import hashlib
import importlib.metadata
import os
import platform
import subprocess
from datetime import datetime
from pathlib import Path

import yaml

from acquisition.engine import Bench
from goniometer.load_files import BenchSetup

_PACKAGES = ("goniometer", "numpy", "scipy", "pyserial")
_GIT_S = 5.0
"""A working tree on a slow network drive must not hold a scan up."""


def provenance(setup: BenchSetup, scene_text: str, begun: datetime) -> dict[str, str]:
    """What a run must remember to be understood and repeated, by key.

    Parameters
    ----------
    setup : Setup
        The recipe and the rig that run, with the texts they were read from.
    scene_text : str
        Of the scene that the bench holds; empty for a real sample.
    begun : datetime
        When the run began, with its time zone.

    Returns
    -------
    dict of str to str
        The texts themselves and their SHA-256; ``started`` in ISO 8601; ``host``, ``user``, ``platform``, ``python``
        and packages' versions; ``recipe_git`` and ``goniometer_git`` as `git_state` says them.
    """
    texts = {"recipe": setup.recipe_text, "rig": setup.rig_text, "scene": scene_text}
    if setup.calibration_text:
        texts["calibration"] = setup.calibration_text
    return {
        **texts,
        **{f"{name}_sha256": hashlib.sha256(text.encode()).hexdigest() for name, text in texts.items() if text},
        "recipe_file": str(setup.recipe_path.resolve()),
        "rig_file": str(setup.rig_path.resolve()),
        **({"scene_file": str(setup.scene_path.resolve())} if setup.scene_path else {}),
        "started": begun.isoformat(timespec="seconds"),
        "host": platform.node(),
        "user": _user(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        **{package: importlib.metadata.version(package) for package in _PACKAGES},
        "recipe_git": git_state(setup.recipe_path.resolve()),
        "goniometer_git": git_state(Path(__file__).resolve().parent),
    }


def devices_text(bench: Bench) -> str:
    """What devices said of themselves, by their names, as YAML; without those that have no serial number to tell."""
    return yaml.safe_dump(dict(bench.identities))


def git_state(path: Path) -> str:
    """The commit of the working tree that holds a file or a folder, with ``-dirty`` when tracked files differ from it.

    Where that cannot be said, the reason stands in parentheses.
    """
    folder = path if path.is_dir() else path.parent
    try:
        if not _git(folder, "ls-files", "--", str(path)):  # a new recipe, or an environment inside somebody's tree
            return "(not under version control)"
        return _git(folder, "rev-parse", "HEAD") + ("-dirty" if _git(folder, "status", "--porcelain", "-uno") else "")
    except FileNotFoundError:
        return "(git is not installed)"
    except OSError as error:
        return f"(git cannot be run: {error.strerror})"
    except subprocess.TimeoutExpired:
        return f"(git did not answer within {_GIT_S:g} s)"
    except subprocess.CalledProcessError as error:
        if "not a git repository" in error.stderr:
            return "(not under version control)"
        return f"(git failed: {' '.join(error.stderr.split())})"


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(  # noqa: S603 (a fixed command in a folder of the user's)
        ["git", "--no-optional-locks", "-C", str(folder), *arguments],  # noqa: S607 (whichever git the user has)
        capture_output=True,
        check=True,
        text=True,
        encoding="utf-8",
        timeout=_GIT_S,
        env=_environment(),
    )
    return done.stdout.strip()


def _environment() -> dict[str, str]:
    """Without what points git at another tree, as within its hooks, and with messages that can be recognised."""
    return {name: value for name, value in os.environ.items() if not name.startswith("GIT_")} | {"LC_ALL": "C"}


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # an account without a name, as in some containers
        return "(unknown)"

"""Whether a run that is to be resumed still meets the bench, the recipe and the sample that it was begun with."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from goniometer.errors import ConfigurationError, DeviceFaultError
from goniometer.load_files import load_rig
from goniometer.rig_file import Rig

_MAY_DIFFER = ("port", "bench")
"""Keys of a rig file that say how a bench is reached, and nothing about what it is."""

_PACKAGES = ("goniometer", "numpy", "scipy")


def rig_to_go_on_with(begun_with: Rig, path: Path) -> Rig:
    """Read a rig file; raises ConfigurationError unless it differs from the run's own in nothing but ports."""
    rig = load_rig(path)
    found = [
        f"{path}: {key} is {now!r}, and was {before!r} when the run was begun"
        for key, before, now in _differences(begun_with.model_dump(mode="json"), rig.model_dump(mode="json"))
    ]
    if found:
        raise ConfigurationError(
            [*found, "A run goes on with the bench it was begun with; only ports may be others. Nothing was moved."]
        )
    return rig


def refuse_other_bench(scene_before: str, scene_now: str) -> None:
    """Raise ConfigurationError when a simulated bench holds another scene, or is none any more, or has become one."""
    if scene_before == scene_now:
        return
    had = f"held {_named(scene_before)}" if scene_before else "was real"
    has = f"holds {_named(scene_now)}" if scene_now else "is real"
    if had.removeprefix("held") == has.removeprefix("holds"):
        has = "holds it with other content"
    raise ConfigurationError(
        [
            f"The bench {had} when the run was begun, and the one that answers {has}: it "
            "is not the same sample. Nothing was moved. Serve the bench with the run's own scene, which stands in "
            "its journal and in scan.nxs, or run the recipe anew."
        ]
    )


def refuse_other_devices(before: str, now: Mapping[str, str]) -> None:
    """Raise DeviceFaultError when a device has another serial number than when the run was begun."""
    for name, said in (yaml.safe_load(before) or {}).items():
        if name in now and now[name] != said:
            raise DeviceFaultError(
                name,
                f"another device answers than when the run was begun: {now[name]!r}, and then {said!r}",
                not_done="the run was not resumed and nothing was moved",
                to_do="look which cable leads where; with another device, run the recipe anew",
            )


def file_notes(about: Mapping[str, str]) -> Iterator[str]:
    """Which of the files that a run was begun with are no longer what they were; the journal's texts count."""
    for kind in ("recipe", "rig"):
        path = Path(about[f"{kind}_file"])
        try:
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError):
            continue  # moved away, or written on another computer
        if text.replace("\r\n", "\n") != about[kind].removeprefix("\ufeff").replace("\r\n", "\n"):
            yield f"{path} was changed since; the run goes on with the {kind} that its journal holds"


def version_notes(about: Mapping[str, str]) -> Iterator[str]:
    """Which versions are others than when the run was begun."""
    for package in _PACKAGES:
        now = importlib.metadata.version(package)
        if about.get(package, now) != now:
            yield f"the run was begun with {package} {about[package]} and goes on with {now}"


def _differences(before: Any, now: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys([*before, *now]):
            if name not in _MAY_DIFFER:
                yield from _differences(before.get(name), now.get(name), f"{key}.{name}" if key else name)
    elif before != now:
        yield key, before, now


def _named(scene_text: str) -> str:
    return repr(yaml.safe_load(scene_text)["scene"])

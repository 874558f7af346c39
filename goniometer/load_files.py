"""From the files a user wrote to a checked recipe, rig and scene; all their faults in one report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from acquisition.recipe import Recipe
from goniometer.cross_checks import path_on_rig, recipe_on_rig, recipe_on_scene, scene_on_rig, time_limit_on_rig
from goniometer.errors import ConfigurationError
from goniometer.faults import model_faults
from goniometer.rig_file import Rig
from goniometer.schema import MODELS, Kind
from goniometer.yaml_file import Fault, YamlFile, read_yaml
from sim_devices.scene import Scene

Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Setup:
    """All that a scan needs to know before a device is opened, with the texts it came from.

    `scene` is None on a rig of real devices.
    """

    recipe: Recipe
    recipe_path: Path
    recipe_text: str
    rig: Rig
    rig_path: Path
    rig_text: str
    scene: Scene | None
    scene_path: Path | None
    scene_text: str


@dataclass(frozen=True)
class SceneSetup:
    """A scene and the rig whose devices it simulates."""

    scene: Scene
    scene_path: Path
    scene_text: str
    rig: Rig
    rig_path: Path
    rig_text: str


def load_recipe(path: Path, rig_path: Path | None = None) -> Setup:
    """Read a recipe with its rig and scene, and check them by themselves and together; opens no device.

    Parameters
    ----------
    path : Path
        The recipe.
    rig_path : Path, optional
        A rig file in place of the recipe's.

    Raises
    ------
    ConfigurationError
        Lists every fault of the three files, sorted by file and line.
    """
    report = _Report()
    recipe_file = report.read(path, "recipe")
    recipe = report.validated(recipe_file, Recipe)
    rig_file = report.read(rig_path, "rig") if rig_path else report.read_named(recipe_file, "rig")
    rig = report.validated(rig_file, Rig)
    is_real = rig is not None and not rig.is_simulated and rig.bench is None
    scene_file = None if is_real else report.read_named(recipe_file, "scene")
    scene = report.validated(scene_file, Scene)
    if recipe and rig and rig_file:
        report.faults += recipe_on_rig(recipe, recipe_file, rig, rig_file.path)
    if scene and scene_file and rig and rig_file:
        report.faults += scene_on_rig(scene, scene_file, rig, rig_file.path)
    if recipe and scene and scene_file:
        report.faults += recipe_on_scene(recipe, recipe_file, scene, scene_file.path)
    if recipe and rig and rig_file and not report.faults:
        report.faults += time_limit_on_rig(recipe, recipe_file, rig, rig_file.path)
        report.faults += path_on_rig(recipe, recipe_file, rig, rig_file.path)
    if report.faults or not (recipe and rig and rig_file):
        raise report.error()
    return Setup(
        recipe=recipe,
        recipe_path=path,
        recipe_text=recipe_file.text,
        rig=rig,
        rig_path=rig_file.path,
        rig_text=rig_file.text,
        scene=scene,
        scene_path=scene_file.path if scene_file else None,
        scene_text=scene_file.text if scene_file else "",
    )


def load_scene(path: Path) -> SceneSetup:
    """Read a scene with its rig, and check them by themselves and together.

    Raises
    ------
    ConfigurationError
        Lists every fault of the two files, sorted by file and line.
    """
    report = _Report()
    scene_file = report.read(path, "scene")
    scene = report.validated(scene_file, Scene)
    rig_file = report.read_named(scene_file, "rig")
    rig = report.validated(rig_file, Rig)
    if scene and rig and rig_file:
        report.faults += scene_on_rig(scene, scene_file, rig, rig_file.path)
    if report.faults or not (scene and rig and rig_file):
        raise report.error()
    return SceneSetup(scene, path, scene_file.text, rig, rig_file.path, rig_file.text)


def load_rig(path: Path) -> Rig:
    """Read a rig and check it.

    Raises
    ------
    ConfigurationError
        Lists every fault of the file, sorted by line.
    """
    report = _Report()
    rig = report.validated(report.read(path, "rig"), Rig)
    if report.faults or not rig:
        raise report.error()
    return rig


def load_file(path: Path) -> Setup | SceneSetup | Rig:
    """Read and check a file of whichever kind its keys show it to be, a recipe, a scene or a rig.

    Raises
    ------
    ConfigurationError
        Lists every fault, sorted by file and line.
    """
    match _likeness(read_yaml(path)):
        case "recipe":
            return load_recipe(path)
        case "scene":
            return load_scene(path)
        case "rig":
            return load_rig(path)


def _likeness(file: YamlFile) -> Kind:
    """Which kind of file the keys at its top are those of."""
    keys = set(file.data or {})
    return max(MODELS, key=lambda kind: len(keys & set(MODELS[kind].model_fields)))


class _Report:
    """Reads and validates files, and collects what is wrong with them."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def read(self, path: Path, kind: Kind) -> YamlFile:
        """Read a file that the caller names; raises ConfigurationError when it is one of another kind."""
        file = read_yaml(path)
        if file.data and not file.faults and (other := _likeness(file)) != kind:
            raise ConfigurationError([str(file.fault((), f"this is a {other}, and a {kind} is needed here"))])
        self.faults += file.faults
        return file

    def read_named(self, file: YamlFile, key: str) -> YamlFile | None:
        """Read the file that another one names; without a usable name there is none."""
        name = (file.data or {}).get(key)
        if not isinstance(name, str) or not name:
            return None
        try:
            path = (file.path.parent / name).resolve()
        except (OSError, ValueError, RuntimeError):
            self.faults.append(file.fault((key,), f"got {name!r}, which cannot be the name of a file"))
            return None
        if path.is_relative_to(Path.cwd()):
            path = path.relative_to(Path.cwd())
        named_file = read_yaml(path)
        for fault in named_file.faults:
            is_unreadable = fault.line is None
            self.faults.append(file.fault((key,), f"{path} {fault.text}") if is_unreadable else fault)
        return named_file

    def validated(self, file: YamlFile | None, model: type[Model]) -> Model | None:
        """Validate a file's data, where there is any."""
        if file is None or file.data is None:
            return None
        try:
            return model.model_validate(file.data)
        except ValidationError as error:
            kind = next(kind for kind, candidate in MODELS.items() if candidate is model)
            self.faults += model_faults(error, file, kind)
            return None

    def error(self) -> ConfigurationError:
        """All faults as one error, sorted by file and line."""
        ordered = sorted(set(self.faults), key=lambda fault: (fault.file, fault.line or 0, fault.text))
        return ConfigurationError([str(fault) for fault in ordered])

"""From the files a user wrote to a checked recipe, rig and scene; all their faults in one report."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition.calibrated_slots import SlotCalibration
from acquisition.calibration_recipe import CalibrationRecipe
from acquisition.recipe import Recipe
from goniometer.calibration_checks import (
    calibration_for_recipe,
    calibration_recipe_on_rig,
    reference_in_scene,
    zeros_for_recipe,
)
from goniometer.cross_checks import path_on_rig, recipe_on_rig, recipe_on_scene, scene_on_rig, time_limit_on_rig
from goniometer.imaging.sensor_files import sensor_file_faults
from goniometer.load_report import Report, likeness
from goniometer.rig_file import Rig
from goniometer.yaml_file import YamlFile, read_yaml
from sim_devices.scene import Scene


@dataclass(frozen=True, kw_only=True)
class BenchSetup:
    """What is to be done on which bench, with the texts it came from; `scene` is None on a rig of real devices."""

    recipe_path: Path
    recipe_text: str
    rig: Rig
    rig_path: Path
    rig_text: str
    scene: Scene | None
    scene_path: Path | None
    scene_text: str
    calibration_text: str = ""

    @property
    def is_read_turning(self) -> bool:
        """Whether the analyzer is read while it turns."""
        return False


@dataclass(frozen=True, kw_only=True)
class Setup(BenchSetup):
    """All that a scan needs to know before a device is opened; `calibration` is None where none is named."""

    recipe: Recipe
    calibration: SlotCalibration | None = None

    @property
    def is_read_turning(self) -> bool:
        """Whether the analyzer is read while it turns."""
        return self.recipe.analyzer_rotation is not None


@dataclass(frozen=True, kw_only=True)
class CalibrationSetup(BenchSetup):
    """All that a calibration needs to know before a device is opened."""

    recipe: CalibrationRecipe


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
    report = Report()
    recipe_file = report.whole(report.read(path, "recipe"))
    recipe = report.validated(recipe_file, Recipe)
    bench = _bench_of(report, recipe_file, rig_path)
    rig_file, rig, scene_file, scene = bench.rig_file, bench.rig, bench.scene_file, bench.scene
    calibration_file = report.read_named(recipe_file, "calibration")
    calibration = report.validated(calibration_file, SlotCalibration)
    if recipe and rig and rig_file:
        report.faults += recipe_on_rig(recipe, recipe_file, rig, rig_file.path)
    if recipe and scene and scene_file:
        report.faults += recipe_on_scene(recipe, recipe_file, scene, scene_file.path)
    if rig and rig_file:
        report.faults += sensor_file_faults(rig, rig_file)
    now = datetime.now(UTC)
    if recipe and rig and rig_file:
        report.faults += zeros_for_recipe(recipe, recipe_file, rig, rig_file.path, now)
    if recipe and rig and calibration and calibration_file:
        report.faults += calibration_for_recipe(recipe, recipe_file, rig, calibration, calibration_file.path, now)
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
        **bench.of_scene(),
        calibration=calibration,
        calibration_text=calibration_file.text if calibration_file else "",
    )


def load_calibration_recipe(path: Path, rig_path: Path | None = None) -> CalibrationSetup:
    """Read the recipe of a calibration with its rig and scene; as `load_recipe`."""
    report = Report()
    recipe_file = report.read(path, "calibration-recipe")
    recipe = report.validated(recipe_file, CalibrationRecipe)
    bench = _bench_of(report, recipe_file, rig_path)
    rig_file, rig, scene_file, scene = bench.rig_file, bench.rig, bench.scene_file, bench.scene
    if recipe and rig and rig_file:
        report.faults += calibration_recipe_on_rig(recipe, recipe_file, rig, rig_file.path)
    if recipe and scene and scene_file:
        report.faults += reference_in_scene(recipe, recipe_file, scene, scene_file.path)
    if report.faults or not (recipe and rig and rig_file):
        raise report.error()
    return CalibrationSetup(
        recipe=recipe,
        recipe_path=path,
        recipe_text=recipe_file.text,
        rig=rig,
        rig_path=rig_file.path,
        rig_text=rig_file.text,
        **bench.of_scene(),
    )


@dataclass(frozen=True)
class _NamedBench:
    """The rig and the scene that a recipe names, as far as they could be read."""

    rig_file: YamlFile | None
    rig: Rig | None
    scene_file: YamlFile | None
    scene: Scene | None

    def of_scene(self) -> dict[str, Any]:
        """What a setup has of the scene."""
        path, text = (self.scene_file.path, self.scene_file.text) if self.scene_file else (None, "")
        return {"scene": self.scene, "scene_path": path, "scene_text": text}


def _bench_of(report: Report, recipe_file: YamlFile, rig_path: Path | None) -> _NamedBench:
    """Read the rig and the scene of a recipe, and check them together."""
    rig_file = report.read(rig_path, "rig") if rig_path else report.read_named(recipe_file, "rig")
    rig = report.validated(rig_file, Rig)
    scene_file, scene = _scene_of(report, recipe_file, rig)
    if scene and scene_file and rig and rig_file:
        report.faults += scene_on_rig(scene, scene_file, rig, rig_file.path)
    return _NamedBench(rig_file, rig, scene_file, scene)


def _scene_of(report: Report, recipe_file: YamlFile, rig: Rig | None) -> tuple[YamlFile | None, Scene | None]:
    """The scene that a recipe names, unless its rig is of real devices."""
    is_real = rig is not None and not rig.is_simulated and rig.bench is None
    scene_file = None if is_real else report.read_named(recipe_file, "scene")
    return scene_file, report.validated(scene_file, Scene)


def load_scene(path: Path) -> SceneSetup:
    """Read a scene with its rig, and check them by themselves and together.

    Raises
    ------
    ConfigurationError
        Lists every fault of the two files, sorted by file and line.
    """
    report = Report()
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
    report = Report()
    rig = report.validated(report.read(path, "rig"), Rig)
    if report.faults or not rig:
        raise report.error()
    return rig


def load_calibration(path: Path) -> SlotCalibration:
    """Read a stored calibration and check it by itself.

    Raises
    ------
    ConfigurationError
        Lists every fault of the file, sorted by line.
    """
    report = Report()
    calibration = report.validated(report.read(path, "calibration"), SlotCalibration)
    if report.faults or not calibration:
        raise report.error()
    return calibration


def load_file(path: Path) -> BenchSetup | SceneSetup | Rig | SlotCalibration:
    """Read and check a file of whichever kind its keys show it to be, a recipe, a scene, a rig or a calibration.

    Raises
    ------
    ConfigurationError
        Lists every fault, sorted by file and line.
    """
    match likeness(read_yaml(path)):
        case "recipe":
            return load_recipe(path)
        case "scene":
            return load_scene(path)
        case "rig":
            return load_rig(path)
        case "calibration-recipe":
            return load_calibration_recipe(path)
        case "calibration":
            return load_calibration(path)

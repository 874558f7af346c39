"""The sample that a scan is planned for: a scene's own, or what a person expects."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from acquisition.fit_points import surface_family
from goniometer.errors import ConfigurationError
from goniometer.load_files import Setup
from model.fit import SurfaceFamily
from model.fit.quantities import NOMINAL
from sim_devices.effects.dark_current import DarkCurrent
from sim_devices.scene import Scene

_ASSUMPTION = re.compile(r"\s*([\w.]+)\s*=\s*([^=±]+?)\s*(?:(?:±|\+-)\s*([^=±]+?)\s*)?")
_HOW = "Write a number, and how uncertain it is if that shall count, for example n=1.5 or n=1.5+-0.1"


@dataclass(frozen=True)
class AssumedSample:
    """Values of a family's free parameters, by the names that the model has for them.

    Parameters
    ----------
    values : mapping of str to float
        Every free parameter.
    uncertain : mapping of str to float
        Standard deviations of those that are not quite known.
    dark_w : float
        Power that the detector shows in the dark, in W.
    source : str
        Where the values come from, for a person.
    """

    values: Mapping[str, float]
    uncertain: Mapping[str, float]
    dark_w: float
    source: str

    def samples(self) -> tuple[Mapping[str, float], ...]:
        """The values, and around them a pair for each uncertain one that together spread as far as is stated."""
        reach = math.sqrt(len(self.uncertain))
        return self.values, *(
            {**self.values, name: self.values[name] + side * reach * stddev}
            for name, stddev in self.uncertain.items()
            for side in (-1.0, 1.0)
        )


def assumed_sample(setup: Setup, assumptions: Sequence[str]) -> AssumedSample:
    """The scene's sample where there is a scene, with what is assumed in its place.

    Parameters
    ----------
    setup : Setup
        The recipe with its rig and scene.
    assumptions : sequence of str
        Such as ``n=1.5`` or ``n=1.5+-0.1``, with parameters named as the recipe and its results name them.

    Raises
    ------
    ConfigurationError
        When an assumption cannot be read or kept, or a free parameter has no value; all that is wrong is listed.
    """
    family = surface_family(setup.recipe.fit, setup.rig.calibration.acceptance_sr)
    faults: list[str] = []
    values = {name: NOMINAL[name] for name in family.instrument}
    sources = []
    if setup.scene is not None:
        truth = {"asymmetry": setup.scene.sample.asymmetry, **setup.scene.truth(setup.recipe.one_wavelength_nm)}
        values |= {name: truth[plain] for name in family.names if (plain := name.rpartition(".")[2]) in truth}
        sources.append(str(setup.scene_path))
    uncertain: dict[str, float] = {}
    for text in assumptions:
        try:
            name, value, stddev = _read(text, family)
        except ValueError as error:
            faults.append(f"--assume {text}: {error}")
            continue
        values[name] = value
        if stddev:
            uncertain[name] = stddev
    sources += ["--assume"] * bool(assumptions)
    missing = [shown(name) for name in family.names if name not in values]
    if missing and not faults:
        faults.append(
            f"{setup.recipe_path}: nothing is known of {', '.join(missing)}, because {setup.rig_path} holds no scene. "
            f"Say what you expect: {' '.join(f'--assume {name}=...' for name in missing)}"
        )
    sample = AssumedSample(values, uncertain, _dark_w(setup.scene), " and ".join(sources))
    faults += [] if faults else _out_of_bounds(sample, family)
    if faults:
        raise ConfigurationError([f"{fault}. Nothing was computed." for fault in faults])
    return sample


def shown(name: str) -> str:
    """A parameter's name as people write it, in degrees where it is an angle."""
    return f"{name.removesuffix('_rad')}_deg" if name.endswith("_rad") else name


def in_shown_unit(name: str) -> float:
    """What a value in the model's unit is multiplied with."""
    return math.degrees(1.0) if name.endswith("_rad") else 1.0


def _read(text: str, family: SurfaceFamily) -> tuple[str, float, float]:
    found = _ASSUMPTION.fullmatch(text)
    if found is None:
        raise ValueError(_HOW)
    known = {shown(name): name for name in family.names}
    if found[1] not in known:
        what = "is held by the recipe" if found[1] in family.fixed or found[1] in family.tied else "is not a parameter"
        raise ValueError(f"{found[1]} {what}; the recipe's fit has {', '.join(known)} free")
    name = known[found[1]]
    try:
        value, stddev = float(found[2]), float(found[3] or 0.0)
    except ValueError:
        raise ValueError(_HOW) from None
    if not (math.isfinite(value) and 0.0 <= stddev < math.inf):
        raise ValueError(_HOW)
    return name, value / in_shown_unit(name), stddev / in_shown_unit(name)


def _out_of_bounds(sample: AssumedSample, family: SurfaceFamily) -> Iterator[str]:
    for name, (low, high) in family.free.items():
        unit = in_shown_unit(name)
        beyond = [of_sample[name] for of_sample in sample.samples() if not low <= of_sample[name] <= high]
        if beyond:
            yield (
                f"{shown(name)} = {beyond[0] * unit:.6g} ({sample.source}) lies outside the recipe's bounds, "
                f"{low * unit:g} to {high * unit:g}: the fit would not find it"
            )


def _dark_w(scene: Scene | None) -> float:
    effects = () if scene is None else scene.effects
    return sum(effect.power_w for effect in effects if isinstance(effect, DarkCurrent))

"""The one world that every simulated device acts on: lamp, sample, axes, analyzer and the light at the detector."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from model.acceptance import Acceptance, half_angle_rad
from model.geometry import in_plane
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices import effects
from sim_devices.axis import Axis
from sim_devices.scene import (
    DarkCurrent,
    NewportEsp301Device,
    OrientalAzDevice,
    Quantisation,
    ReadNoise,
    Scene,
    ShotNoise,
    Slot,
    ThorlabsFw102cDevice,
    ThorlabsPm100Device,
)
from sim_devices.wheel import Wheel

# Newport URS stages resolve 0.0005 deg; the AZ drive's step is the scene's
_ARM_STEP_DEG = 0.0005
_PLANCK_J_S = 6.62607015e-34
_LIGHT_SPEED_M_S = 299792458.0


class World:
    """Lamp, sample, axes and analyzer, all as functions of time, and the light that reaches the detector.

    Parameters
    ----------
    scene : Scene
        What the bench holds. Every axis starts at 0 deg and the wheel at slot 1.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.axes: dict[str, Axis] = {}
        self.wheel = Wheel()
        for device in scene.devices.values():
            if isinstance(device, NewportEsp301Device):
                self.axes |= {role: Axis(_ARM_STEP_DEG) for role in device.axes.values()}
            elif isinstance(device, OrientalAzDevice):
                self.axes[device.axis] = Axis(device.step_deg)
            elif isinstance(device, ThorlabsFw102cDevice):
                self._rows = {slot: analyzer_row(holds) for slot, holds in device.slots.items()}
            elif isinstance(device, ThorlabsPm100Device):
                self._acceptance_sr = device.acceptance_sr
        self._sample: Surface | Acceptance = surface(scene)
        if scene.has_acceptance_cone:
            self._sample = Acceptance(surface(scene), half_angle_rad(self._acceptance_sr))
        self._stokes = remember_last(self._sample.stokes)
        self._stokes(0.0, 0.5, 0.0)  # compiles the surface now, before a device has to answer in time
        self._parts = _detector_parts(scene)
        self._detect = effects.chain(list(self._parts.values()))
        self._measurements = 0

    def power_w(self, time_s: float) -> float:
        """Power at the detector at `time_s`, before any effect of the detector.

        ``power acceptance cos(exit) (analyzer row · Stokes)``; nothing while the wheel turns, through a slot that
        holds nothing to look through, or when lamp or detector is below the sample's horizon.
        """
        row = self._rows.get(self.wheel.slot(time_s) or 0)
        incidence_deg = self.axes["source_arm"].position_deg(time_s)
        exit_deg = self.axes["detector_arm"].position_deg(time_s)
        if row is None or abs(incidence_deg) >= 90 or abs(exit_deg) >= 90:
            return 0.0
        if incidence_deg < 0:
            # the plane of incidence turned by 180 deg about the normal
            incidence_deg, exit_deg = -incidence_deg, -exit_deg
        exit_rad, azimuth_rad = in_plane(math.radians(exit_deg))
        stokes = self._stokes(math.radians(incidence_deg), float(exit_rad), float(azimuth_rad))
        reaching_w = self.scene.lamp.power_w * self._acceptance_sr * math.cos(math.radians(exit_deg))
        return max(0.0, reaching_w * float(row @ stokes))

    def measure_w(self, time_s: float, exposure_s: float) -> float:
        """One measurement that begins at `time_s`: the power at its middle, through the detector's effects."""
        measurement = effects.Measurement(self.scene.seed, self._measurements, exposure_s)
        self._measurements += 1
        return self._detect(self.power_w(time_s + exposure_s / 2), measurement)

    def describe(self) -> str:
        """Which effects are on the detector's path, in order, and which are not there at all."""
        named = {effect.effect for effect in self.scene.effects}
        present = ", ".join(name for name in _ORDER if name in named) or "nothing"
        absent = ", ".join(name for name in _ORDER if name not in named) or "nothing"
        return f"On the detector's path: {present}. Not there, because the scene does not name it: {absent}."


def surface(scene: Scene) -> Surface:
    """The sample's surface, made of those lobes whose weight is not zero."""
    sample, index = scene.sample, scene.index()
    lobes = (
        Specular(sample.rho_s, sample.sigma, index, sample.asymmetry, sample.bounces),
        Diffuse(sample.rho_d, sample.sigma),
        Directional(sample.rho_dd, sample.sigma, index),
    )
    return Surface([lobe for lobe in lobes if lobe.weight > 0])


def analyzer_row(slot: Slot) -> NDArray[np.float64] | None:
    """First row of the Mueller matrix of a slot: open, a polarizer (angle in degrees), or None for a lid."""
    if slot == "blocked":
        return None
    if slot == "open":
        return np.array([1.0, 0.0, 0.0, 0.0])
    twice_rad = 2 * math.radians(slot)
    return 0.5 * np.array([1.0, math.cos(twice_rad), math.sin(twice_rad), 0.0])


def remember_last(
    stokes: Callable[[float, float, float], NDArray[np.floating]],
) -> Callable[[float, float, float], NDArray[np.floating]]:
    """Evaluate a surface only when the geometry has changed."""
    last: tuple[tuple[float, float, float], NDArray[np.floating]] | None = None

    def evaluate(incidence_rad: float, exit_rad: float, azimuth_rad: float) -> NDArray[np.floating]:
        nonlocal last
        geometry = (incidence_rad, exit_rad, azimuth_rad)
        if last is None or last[0] != geometry:
            last = geometry, stokes(*geometry)
        return last[1]

    return evaluate


# the order in which light and electrons meet them, whatever the order in the file
_ORDER = ("acceptance_cone", "dark_current", "shot_noise", "read_noise", "quantisation")


def _detector_parts(scene: Scene) -> dict[str, effects.Part]:
    photon_energy_j = _PLANCK_J_S * _LIGHT_SPEED_M_S / (scene.lamp.wavelength_nm * 1e-9)
    parts: dict[str, effects.Part] = {}
    for effect in sorted(scene.effects, key=lambda effect: _ORDER.index(effect.effect)):
        match effect:
            case DarkCurrent(power_w=power_w):
                parts[effect.effect] = effects.dark_current(power_w)
            case ShotNoise():
                parts[effect.effect] = effects.shot_noise(photon_energy_j)
            case ReadNoise(power_w=power_w):
                parts[effect.effect] = effects.read_noise(power_w)
            case Quantisation(digits=digits):
                parts[effect.effect] = effects.quantisation(digits)
    return parts

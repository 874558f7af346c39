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
from sim_devices.analyzer import Analyzer
from sim_devices.axis import Axis
from sim_devices.bench_devices.entry import AxisRole
from sim_devices.device import Device
from sim_devices.scene import DarkCurrent, Quantisation, ReadNoise, Scene, ShotNoise

_PLANCK_J_S = 6.62607015e-34
_LIGHT_SPEED_M_S = 299792458.0


class World:
    """Lamp, sample, axes and analyzer, all as functions of time, and the light that reaches the detector.

    Parameters
    ----------
    scene : Scene
        What the bench holds. Every axis starts at 0 deg and a wheel at slot 1.

    Attributes
    ----------
    axes : dict of str to Axis
        What turns, by its role.
    analyzer : Analyzer
        What stands before the detector.
    acceptance_sr : float
        Solid angle that the detector accepts.
    devices : dict of str to Device
        What answers at the devices' ports, by their names in the scene.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.axes: dict[str, Axis] = {}
        self.analyzer: Analyzer
        self.acceptance_sr: float
        self.devices: dict[str, Device] = {name: device.install(self) for name, device in scene.devices.items()}
        self._sample: Surface | Acceptance = surface(scene)
        if scene.has_acceptance_cone:
            self._sample = Acceptance(surface(scene), half_angle_rad(self.acceptance_sr))
        self._stokes = remember_last(self._sample.stokes)
        self._stokes(0.0, 0.5, 0.0)  # compiles the surface now, before a device has to answer in time
        self._parts = _detector_parts(scene)
        self._detect = effects.chain(list(self._parts.values()))
        self._measurements = 0

    def add_axis(self, role: AxisRole, step_deg: float) -> Axis:
        """A new axis in a role of the bench, for the controller that turns it."""
        self.axes[role] = axis = Axis(step_deg)
        return axis

    def power_w(self, time_s: float) -> float:
        """Power at the detector at `time_s`, before any effect of the detector.

        ``power acceptance cos(exit) (analyzer row · Stokes)``; nothing while the wheel turns, through a slot that
        holds nothing to look through, or when lamp or detector is below the sample's horizon.
        """
        row = self.analyzer.row(time_s)
        incidence_deg = self.axes["source_arm"].position_deg(time_s)
        exit_deg = self.axes["detector_arm"].position_deg(time_s)
        if row is None or abs(incidence_deg) >= 90 or abs(exit_deg) >= 90:
            return 0.0
        if incidence_deg < 0:
            # the plane of incidence turned by 180 deg about the normal
            incidence_deg, exit_deg = -incidence_deg, -exit_deg
        exit_rad, azimuth_rad = in_plane(math.radians(exit_deg))
        stokes = self._stokes(math.radians(incidence_deg), float(exit_rad), float(azimuth_rad))
        reaching_w = self.scene.lamp.power_w * self.acceptance_sr * math.cos(math.radians(exit_deg))
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

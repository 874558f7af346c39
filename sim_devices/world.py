"""The one world that every simulated device acts on: lamp, sample, axes, analyzer and the light at the detector."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from model.acceptance import Acceptance
from model.geometry import in_plane
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.analyzer import Analyzer, Row
from sim_devices.axis import AngleOfTime, Axis
from sim_devices.bench_devices.entry import AxisRole
from sim_devices.contact import ContactWatch
from sim_devices.device import Device
from sim_devices.effects.entry import Effect
from sim_devices.effects.known import IN_ORDER, name_of
from sim_devices.effects.measurement import Measurement, Moment, Stokes
from sim_devices.scene import Scene


class World:
    """Lamp, sample, axes and analyzer, all as functions of time, and the light that reaches the detector.

    Light goes through four functions, each of which an effect may wrap: where the arms truly are, what arrives at the
    analyzer, what the analyzer passes, and what the detector tells. Without an effect they are those of this class.

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
    angle_deg : dict of str to callable
        Where what an axis turns truly is at a time, by the axis' role; without effects the motor's position itself.
    arriving_w : callable
        Stokes vector of the power that arrives at the analyzer in a moment, shape (4,).
    row : callable
        First row of the analyzer's Mueller matrix at a time; None while it lets no light through.
    signal_w : callable
        What the detector tells of a measurement; infinite when it is over its range.
    contact_watch : ContactWatch or None
        Looks whether arms touch, when the scene says how much room they take.
    detector_half_angle_rad, source_half_angle_rad : float
        Cones over which the sample is averaged; 0 for a single direction.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.axes: dict[str, Axis] = {}
        self.angle_deg: dict[str, AngleOfTime] = {}
        self.analyzer: Analyzer
        self.acceptance_sr: float
        self.devices: dict[str, Device] = {}
        # a rotating analyzer is carried by an axis that another device puts there
        for name, entry in sorted(scene.devices.items(), key=lambda item: item[1].part != "axes"):
            if (device := entry.install(self)) is not None:
                self.devices[name] = device
        self.arriving_w: Callable[[Moment], Stokes] = self._reflected_w
        self.row: Callable[[float], Row | None] = self.analyzer.row
        self.signal_w: Callable[[Measurement], float] = self._passed_w
        self.detector_half_angle_rad = self.source_half_angle_rad = 0.0
        for effect in _in_order(scene.effects):
            effect.install(self)
        self.contact_watch = ContactWatch(scene.bodies, self.axes, self.angle_deg) if scene.bodies else None
        self._sample: Surface | Acceptance = surface(scene)
        if self.detector_half_angle_rad or self.source_half_angle_rad:
            self._sample = Acceptance(surface(scene), self.detector_half_angle_rad, self.source_half_angle_rad)
        self._stokes = remember_last(self._sample.stokes)
        self._stokes(0.0, 0.5, 0.0)  # compiles the surface now, before a device has to answer in time
        self._measurements = 0

    def add_axis(self, role: AxisRole, step_deg: float) -> Axis:
        """A new axis in a role of the bench, for the controller that turns it."""
        self.axes[role] = axis = Axis(step_deg, self.scene.start_deg.get(role, 0.0))
        self.angle_deg[role] = axis.motor_deg
        return axis

    def power_w(self, time_s: float) -> float:
        """Power at the detector at `time_s`, before any effect of the detector."""
        return self._passed_w(Moment(time_s, 0.0))

    def measure_w(self, time_s: float, exposure_s: float) -> float:
        """One measurement that begins at `time_s`: the power at its middle, through the detector's effects."""
        measurement = Measurement(time_s + exposure_s / 2, exposure_s, self.scene.seed, self._measurements)
        self._measurements += 1
        return self.signal_w(measurement)

    def describe(self) -> str:
        """Which effects are between motors and readings, in order, and which are not there at all."""
        present = [effect.title for effect in _in_order(self.scene.effects)]
        named = {effect.effect for effect in self.scene.effects}
        absent = [name for name in map(name_of, IN_ORDER) if name not in named]
        return (
            f"Between motors and readings: {', '.join(present) or 'nothing'}. "
            f"Not there, because the scene does not name it: {', '.join(absent) or 'nothing'}."
        )

    def _passed_w(self, moment: Moment) -> float:
        """Analyzer row · Stokes; nothing while the wheel turns or its slot holds nothing to look through."""
        row = self.row(moment.middle_s)
        return 0.0 if row is None else max(0.0, float(row @ self.arriving_w(moment)))

    def _reflected_w(self, moment: Moment) -> Stokes:
        """Power acceptance cos(exit) Stokes; nothing when lamp or detector is below the sample's horizon."""
        incidence_deg = _within_a_turn(self.angle_deg["source_arm"](moment.middle_s))
        exit_deg = _within_a_turn(self.angle_deg["detector_arm"](moment.middle_s))
        if abs(incidence_deg) >= 90 or abs(exit_deg) >= 90:
            return np.zeros(4)
        if incidence_deg < 0:
            # the plane of incidence turned by 180 deg about the normal
            incidence_deg, exit_deg = -incidence_deg, -exit_deg
        exit_rad, azimuth_rad = in_plane(math.radians(exit_deg))
        stokes = self._stokes(math.radians(incidence_deg), float(exit_rad), float(azimuth_rad))
        reaching_w = self.scene.lamp.power_w * self.acceptance_sr * math.cos(math.radians(exit_deg))
        return reaching_w * stokes


def _within_a_turn(angle_deg: float) -> float:
    """The same direction from -180 to 180 degrees; a stage that is homed over its switch may count whole turns."""
    return angle_deg if abs(angle_deg) <= 180 else math.remainder(angle_deg, 360)


def _in_order(effects: Sequence[Effect]) -> list[Effect]:
    """In the order in which motors, light and electrons meet them, whatever the order in the file."""
    return sorted(effects, key=lambda effect: IN_ORDER.index(type(effect)))


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
    stokes: Callable[[float, float, float], Stokes],
) -> Callable[[float, float, float], Stokes]:
    """Evaluate a surface only when the geometry has changed."""
    last: tuple[tuple[float, float, float], Stokes] | None = None

    def evaluate(incidence_rad: float, exit_rad: float, azimuth_rad: float) -> Stokes:
        nonlocal last
        geometry = (incidence_rad, exit_rad, azimuth_rad)
        if last is None or last[0] != geometry:
            last = geometry, stokes(*geometry)
        return last[1]

    return evaluate

"""The one world that every simulated device acts on: lamp, sample, axes, analyzer and the light at the detector."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from model.acceptance import Acceptance
from model.geometry import in_plane
from model.mueller import UNPOLARIZED
from model.surface import Surface
from sim_devices.analyzer import Analyzer, Row
from sim_devices.axis import AngleOfTime, Axis
from sim_devices.bench_devices.entry import AxisRole
from sim_devices.contact import ContactWatch
from sim_devices.device import Device
from sim_devices.effects.entry import Effect
from sim_devices.effects.known import IN_ORDER, name_of
from sim_devices.effects.measurement import Measurement, Moment, Stokes
from sim_devices.filters import Filters
from sim_devices.generator import RotatingGenerator
from sim_devices.past import Past
from sim_devices.scene import Scene
from sim_devices.turning import TurningRow

_DIRECTION: tuple[AxisRole, ...] = ("source_arm", "detector_arm", "detector_azimuth")
"""What the light depends on; the last one only where there is one."""


class World:
    """Lamp, sample, axes and analyzer, all as functions of time, and the light that reaches the detector.

    Light goes through four functions, each of which an effect may wrap: where the arms truly are, what arrives at the
    analyzer, what the analyzer passes, and what the detector tells. Without an effect they are those of this class.

    Parameters
    ----------
    scene : Scene
        What the bench holds. Every axis starts at 0 deg and a wheel at slot 1.
    past : Past
        What it has been through before.
    folder : Path
        Where relative paths in the scene begin.

    Attributes
    ----------
    axes : dict of str to Axis
        What turns, by its role.
    analyzer : Analyzer
        What stands before the detector.
    turning : TurningRow or None
        Averages the row of an analyzer on rotators over an exposure; None for one that has slots.
    generator : RotatingGenerator or None
        What polarizes the lamp's light before the sample.
    acceptance_sr : float
        Solid angle that the detector accepts.
    devices : dict of str to Device
        What answers at the devices' ports, by their names in the scene.
    when_whole : list of callable
        What devices do once all of them and all effects are in place.
    filters : Filters or None
        What stands between lamp and sample; None where the lamp itself has one wavelength.
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
    lamp_stokes : ndarray
        Stokes vector of the lamp's light in the frame of the incoming ray, shape (4,), with S0 = 1.
    detector_half_angle_rad, source_half_angle_rad : float
        Cones over which the sample is averaged; 0 for a single direction.
    """

    def __init__(self, scene: Scene, past: Past = Past(), folder: Path = Path()) -> None:  # noqa: B008 (frozen)
        self.scene, self.past, self.folder = scene, past, folder
        self.axes: dict[str, Axis] = {}
        self.angle_deg: dict[str, AngleOfTime] = {}
        self.analyzer: Analyzer
        self.turning: TurningRow | None = None
        self.generator: RotatingGenerator | None = None
        self.acceptance_sr: float
        self.filters: Filters | None = None
        self.devices: dict[str, Device] = {}
        self.when_whole: list[Callable[[], None]] = []
        # a rotating analyzer is carried by an axis that another device puts there
        for name, entry in sorted(scene.devices.items(), key=lambda item: item[1].part != "axes"):
            if (device := entry.install(self)) is not None:
                self.devices[name] = device
        self.arriving_w: Callable[[Moment], Stokes] = self._reflected_w
        self.row: Callable[[float], Row | None] = self.analyzer.row
        self.signal_w: Callable[[Measurement], float] = self._passed_w
        self.lamp_stokes: Stokes = UNPOLARIZED
        self.detector_half_angle_rad = self.source_half_angle_rad = 0.0
        for effect in _in_order(scene.effects):
            effect.install(self)
        self.contact_watch = ContactWatch(scene.bodies, self.axes, self.angle_deg) if scene.bodies else None
        self._samples = {wavelength_nm: self._sample(wavelength_nm) for wavelength_nm in scene.wavelengths_nm()}
        # what was seen last, a Stokes vector or a matrix, which stays as long as the arms and the filter do
        self._seen: tuple[tuple[float, ...], Stokes] | None = None
        self._measurements = past.measurements
        for act in self.when_whole:
            act()

    def add_axis(self, role: AxisRole, step_deg: float) -> Axis:
        """A new axis in a role of the bench, for the controller that turns it."""
        self.axes[role] = axis = Axis(step_deg, self.scene.start_deg.get(role, 0.0))
        self.angle_deg[role] = axis.motor_deg
        return axis

    def power_w(self, time_s: float) -> float:
        """Power at the detector at `time_s`, before any effect of the detector."""
        return self._passed_w(Moment(time_s, 0.0))

    def measure_w(self, time_s: float, exposure_s: float) -> float:
        """One measurement that begins at `time_s`: the power at its middle, through the detector's effects.

        Only a polarizer or retarder that turns meanwhile is averaged over the exposure.
        """
        return self.signal_w(self.next_measurement(time_s, exposure_s))

    def next_measurement(self, time_s: float, exposure_s: float, lit: float = 1.0) -> Measurement:
        """A measurement that begins at `time_s`, with random numbers of its own."""
        self._measurements += 1
        return Measurement(
            time_s + exposure_s / 2, exposure_s, lit, seed=self.scene.seed, number=self._measurements - 1
        )

    def wavelength_nm(self, time_s: float) -> float:
        """The wavelength of the light at a time."""
        if self.filters is not None:
            return self.filters.wavelength_nm(time_s)
        assert self.scene.lamp.wavelength_nm is not None, "a scene without filters is only accepted with it"
        return self.scene.lamp.wavelength_nm

    def _sample(self, wavelength_nm: float) -> Surface | Acceptance:
        sample: Surface | Acceptance = surface(self.scene, wavelength_nm)
        if self.detector_half_angle_rad or self.source_half_angle_rad:
            sample = Acceptance(
                surface(self.scene, wavelength_nm), self.detector_half_angle_rad, self.source_half_angle_rad
            )
        # compiles the surface now, before a device has to answer in time
        self._answer(sample, 0.0, 0.5, 0.0)
        return sample

    def describe(self) -> str:
        """Which effects are between motors and readings, in order, and which are not there at all."""
        present = [effect.title for effect in _in_order(self.scene.effects)]
        named = {effect.effect for effect in self.scene.effects}
        absent = [name for name in map(name_of, IN_ORDER) if name not in named]
        return (
            f"Between motors and readings: {', '.join(present) or 'nothing'}. "
            f"Not there, because the scene does not name it: {', '.join(absent) or 'nothing'}."
        )

    def mean_row(self, moment: Moment) -> Row | None:
        """First row of the analyzer's Mueller matrix over an exposure; None while it lets no light through."""
        return self.row(moment.middle_s) if self.turning is None else self.turning(self.row, moment)

    def _passed_w(self, moment: Moment) -> float:
        """Analyzer row · Stokes; nothing while the wheel turns or its slot holds nothing to look through."""
        row = self.mean_row(moment)
        return 0.0 if row is None else max(0.0, float(row @ self.arriving_w(moment)))

    def _reflected_w(self, moment: Moment) -> Stokes:
        """What the sample sends to the detector, for the share of the time in which the lamp's light gets through."""
        if moment.reflected is not None:
            return moment.reflected
        time_s, lit = moment.middle_s, moment.lit
        if self.filters is not None:
            passed = self.filters.in_beam(time_s)
            lit *= 0.0 if passed is None else passed.transmission
        angles_deg = (self.angle_deg[role](time_s) for role in _DIRECTION if role in self.angle_deg)
        place = (self.wavelength_nm(time_s), *angles_deg)
        if self._seen is None or self._seen[0] != place:
            self._seen = place, self._seen_at(*place)
        seen = self._seen[1]
        if self.generator is not None:
            seen = seen @ self.generator.stokes(time_s, self.lamp_stokes)
        return seen if lit == 1 else lit * seen

    def _answer(
        self, sample: Surface | Acceptance, incidence_rad: float, exit_rad: float, azimuth_rad: float
    ) -> Stokes:
        """What a sample makes of the lamp's light, (4,); behind a generator, which turns, of all light, (4, 4)."""
        if self.generator is not None:
            return sample.mueller(incidence_rad, exit_rad, azimuth_rad)
        return sample.stokes(incidence_rad, exit_rad, azimuth_rad, self.lamp_stokes)

    def _seen_at(
        self, wavelength_nm: float, source_arm_deg: float, detector_arm_deg: float, detector_azimuth_deg: float = 0.0
    ) -> Stokes:
        """Power acceptance cos(exit) Stokes or Mueller; nothing when lamp or detector is below the sample's horizon.

        The detector's azimuth turns the detector arm, and the analyzer on it, about the sample's normal: the analyzer's
        s-direction stays perpendicular to the normal, as that of the model's exit frame.
        """
        incidence_deg, exit_deg = _within_a_turn(source_arm_deg), _within_a_turn(detector_arm_deg)
        if abs(incidence_deg) >= 90 or abs(exit_deg) >= 90:
            return np.zeros(4 if self.generator is None else (4, 4))
        if incidence_deg < 0:
            # the plane of incidence turned by 180 deg about the normal
            incidence_deg, exit_deg = -incidence_deg, -exit_deg
        exit_rad, azimuth_rad = in_plane(math.radians(exit_deg))
        phi_rad = float(azimuth_rad) + math.radians(detector_azimuth_deg)
        sample = self._samples[wavelength_nm]
        answer = self._answer(sample, math.radians(incidence_deg), float(exit_rad), phi_rad)
        reaching_w = self.scene.lamp.power_w * self.acceptance_sr * math.cos(math.radians(exit_deg))
        return reaching_w * answer


def _within_a_turn(angle_deg: float) -> float:
    """The same direction from -180 to 180 degrees; a stage that is homed over its switch may count whole turns."""
    return angle_deg if abs(angle_deg) <= 180 else math.remainder(angle_deg, 360)


def _in_order(effects: Sequence[Effect]) -> list[Effect]:
    """In the order in which motors, light and electrons meet them, whatever the order in the file."""
    return sorted(effects, key=lambda effect: IN_ORDER.index(type(effect)))


def surface(scene: Scene, wavelength_nm: float | None = None) -> Surface:
    """The sample's surface at a wavelength, made of those lobes whose weight is not zero; as `Scene.index` takes it."""
    return scene.sample.surface(wavelength_nm or scene.wavelengths_nm()[0])

"""What a simulated bench holds: the scene file, as frozen models."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Annotated

from pydantic import Field, model_validator

from model import materials
from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice
from sim_devices.bench_devices.filters import FilterDevice
from sim_devices.bench_devices.http_camera import camera_faults
from sim_devices.bench_devices.known import AnyDevice
from sim_devices.camera.plate import Plate
from sim_devices.contact import Bodies
from sim_devices.effects.known import AnyEffect
from sim_devices.faults.known import AnyFault
from sim_devices.sample import Sample
from sim_devices.scene_part import ScenePart


class Lamp(ScenePart):
    """The source: unpolarized, of one wavelength, or white behind filters."""

    power_w: float = Field(gt=0, le=10, description="power of the beam on the sample, without a filter, in W")
    wavelength_nm: float | None = Field(
        default=None, ge=200, le=2000, description="wavelength, in nm; leave out where filters choose it"
    )


class Scene(ScenePart):
    """One simulated bench: sample, lamp, devices, and what disturbs them.

    `rig` is the path of the rig file whose devices the bench simulates, as written.
    """

    scene: str = Field(min_length=1, description="name of the scene, for a person")
    rig: str = Field(
        min_length=1, description="rig whose devices the bench simulates; a relative path starts at this file's folder"
    )
    seed: int = Field(ge=0, lt=2**63, description="the same seed gives the same noise")
    sample: Sample = Field(description="the surface in the beam")
    lamp: Lamp = Field(description="the source")
    devices: dict[str, AnyDevice] = Field(description="the devices, each under the name it has in the rig")
    start_deg: dict[AxisRole, float] = Field(
        default_factory=dict, description="where axes stand when the bench is switched on, in degrees; 0 if not named"
    )
    plate: Plate | None = Field(
        default=None, description="what lies in the sample plane before a camera, which needs it"
    )
    bodies: Bodies | None = Field(
        default=None, description="how much room the arms take; without it they pass through each other"
    )
    effects: Annotated[tuple[AnyEffect, ...], Field(strict=False)] = Field(
        description="what disturbs arms, light and readings; an effect that is not named costs nothing"
    )
    faults: Annotated[tuple[AnyFault, ...], Field(strict=False)] = Field(
        default=(), description="what goes wrong while the bench is used, and when; see docs/faults.md"
    )

    @model_validator(mode="after")
    def _is_a_whole_bench(self) -> Scene:
        parts = Counter(device.part for device in self.devices.values())
        faults = [
            f"a bench needs exactly one {needed}, and this one has {parts[needed]}"
            for needed in ("analyzer", "detector")
            if parts[needed] != 1
        ]
        if parts["generator"] > 1:
            faults.append(f"a bench has at most one generator, and this one has {parts['generator']}")
        if parts["filter"] > 1:
            faults.append(f"a bench has one wheel of filters at most, and this one has {parts['filter']}")
        if (self.lamp.wavelength_nm is None) != (parts["filter"] > 0):
            faults.append(
                "the filters say which wavelengths there are: leave the lamp's wavelength_nm out"
                if parts["filter"]
                else "the lamp has no wavelength_nm, and no filters choose one"
            )
        roles = Counter(role for device in self.devices.values() for role in device.roles())
        faults += [
            f"exactly one device must turn {role}, and here {roles[role]} do"
            for role in ("source_arm", "detector_arm", "sample_azimuth")
            if roles[role] != 1
        ]
        if roles["detector_azimuth"] > 1:
            faults.append(f"at most one device may turn detector_azimuth, and here {roles['detector_azimuth']} do")
        faults += [
            f"the effect {part.title} is on an axis that no device turns; name a device that turns it, or leave it out"
            for part in self.effects
            if (axis := getattr(part, "axis", None)) is not None and not roles[axis]
        ]
        faults += _line_faults(self.devices)
        named = Counter(part.title for part in self.effects)
        faults += [
            f"the effect {name} is given {count} times; give it once" for name, count in named.items() if count > 1
        ]
        if parts["analyzer"] == 1:
            (analyzer,) = (device for device in self.devices.values() if device.part == "analyzer")
            slots = getattr(analyzer, "slots", {})
            faults += [fault for part in self.effects for fault in part.faults(slots)]
        faults += camera_faults(self.devices.values(), self.plate, self.effects)
        faults += [objection for fault in self.faults for objection in fault.objections(self.devices)]
        faults += [objection for fault in self.faults for objection in fault.objections_of(self.plate)]
        if self.sample.bounces > 1 and "acceptance_cone" not in named:
            faults.append(
                f"light of {self.sample.bounces} bounces has a pole in the mirror direction, which only the mean over "
                "the detector's cone makes finite; name the effect acceptance_cone, or take bounces: 1"
            )
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @model_validator(mode="after")
    def _material_is_tabulated(self) -> Scene:
        if self.sample.material is not None:
            for wavelength_nm in self.wavelengths_nm():
                materials.index(self.sample.material, wavelength_nm)
        return self

    def wavelengths_nm(self) -> tuple[float, ...]:
        """The wavelengths of its light, the lamp's one or those of its filters."""
        filters = next((device for device in self.devices.values() if isinstance(device, FilterDevice)), None)
        if filters is not None:
            return tuple(held.wavelength_nm for held in filters.filters.values())
        return () if self.lamp.wavelength_nm is None else (self.lamp.wavelength_nm,)

    def index(self, wavelength_nm: float | None = None) -> complex:
        """Refractive index n + ik of the sample at a wavelength; without one, at the first that there is."""
        return self.sample.index_at(wavelength_nm or self.wavelengths_nm()[0])

    def truth(self, wavelength_nm: float | None = None) -> dict[str, float]:
        """The parameters that a fit of this scene should find at a wavelength, as `index` takes it.

        They are sigma, n, k, weights, and what asymmetry there is.
        """
        index, sample = self.index(wavelength_nm), self.sample
        return {
            "sigma": sample.sigma,
            "n": index.real,
            "k": index.imag,
            **({"asymmetry": sample.asymmetry} if sample.asymmetry else {}),
            "rho_s": sample.rho_s,
            "rho_d": sample.rho_d,
            "rho_dd": sample.rho_dd,
        }


def _line_faults(devices: Mapping[str, SimulatedDevice]) -> Iterator[str]:
    """What keeps devices from sharing the lines that they are on."""
    lines: dict[str, dict[str, SimulatedDevice]] = {}
    for name, device in devices.items():
        if device.line is not None:
            lines.setdefault(device.line, {})[name] = device
    for line, members in lines.items():
        first: dict[tuple[str, str], str] = {}
        for name, device in members.items():
            if device.place is None:
                if len(members) > 1:
                    yield f"{name} shares the line {line}, and a {device.type} has no address there: leave its line out"
            elif (other := first.setdefault(device.place, name)) != name:
                yield f"{other} and {name} share the line {line}, and both are {device.place[1]}; give each its own"
        if len(spoken := sorted({speaks for speaks, _ in first})) > 1:
            yield f"the devices on the line {line} speak {' and '.join(spoken)}; a line has one language"

"""What a simulated bench holds: the scene file, as frozen models."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

from pydantic import Field, model_validator

from model import materials
from sim_devices.bench_devices.known import AnyDevice
from sim_devices.scene_part import ScenePart


class Index(ScenePart):
    """Complex refractive index n + ik."""

    n: float = Field(ge=1e-3, le=20, description="real part")
    k: float = Field(ge=0, le=20, description="imaginary part, 0 for a transparent material")


class Sample(ScenePart):
    """The surface in the beam: rms slope `sigma`, the weights of its three lobes, and its material or its index."""

    material: str | None = Field(default=None, description="a material of the table, for example Fe; or write index")
    index: Index | None = Field(default=None, description="refractive index n + ik; or write material")
    sigma: float = Field(ge=1e-5, le=2, description="roughness: rms slope per axis")
    asymmetry: float = Field(
        default=0.0, ge=0, le=0.99, description="a of grooves whose walls have slopes t(1 + a) and t(1 - a)"
    )
    bounces: int = Field(default=1, ge=1, le=12, description="reflections inside the grooves that are followed")
    rho_s: float = Field(ge=0, le=10, description="weight of the specular lobe")
    rho_d: float = Field(ge=0, le=10, description="weight of the diffuse lobe")
    rho_dd: float = Field(ge=0, le=10, description="weight of the directional diffuse lobe")

    @model_validator(mode="after")
    def _has_one_index(self) -> Sample:
        if (self.material is None) == (self.index is None):
            raise ValueError("a sample needs a material or an index, and exactly one of the two")
        if self.material is not None and self.material not in materials.names():
            known = ", ".join(materials.names())
            raise ValueError(
                f"the material {self.material!r} is not known; known are {known}; for another give index: {{n, k}}"
            )
        return self

    @model_validator(mode="after")
    def _reflects(self) -> Sample:
        if self.rho_s == self.rho_d == self.rho_dd == 0:
            raise ValueError("rho_s, rho_d and rho_dd are all 0: such a sample reflects nothing; raise at least one")
        return self


class Lamp(ScenePart):
    """The source: unpolarized, of one wavelength."""

    power_w: float = Field(gt=0, le=10, description="power of the beam on the sample, in W")
    wavelength_nm: float = Field(ge=200, le=2000, description="wavelength, in nm")


class DarkCurrent(ScenePart):
    """Power that the detector reports in the dark."""

    effect: Literal["dark_current"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=1e-3, description="power reported in the dark, in W")


class AcceptanceCone(ScenePart):
    """The detector takes the mean over its cone of directions; needed where light is followed for several bounces."""

    effect: Literal["acceptance_cone"] = Field(description="the effect's name")


class ShotNoise(ScenePart):
    """The statistics of counting photons."""

    effect: Literal["shot_noise"] = Field(description="the effect's name")


class ReadNoise(ScenePart):
    """The detector's own noise: standard deviation of one 3 ms sample."""

    effect: Literal["read_noise"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=1e-3, description="standard deviation of one 3 ms sample, in W")


class Quantisation(ScenePart):
    """Significant digits of a reading."""

    effect: Literal["quantisation"] = Field(description="the effect's name")
    digits: int = Field(ge=1, le=15, description="significant digits of a printed reading")


Effect = Annotated[AcceptanceCone | DarkCurrent | ShotNoise | ReadNoise | Quantisation, Field(discriminator="effect")]


class Scene(ScenePart):
    """One simulated bench: sample, lamp, devices, and the effects of its detector.

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
    effects: Annotated[tuple[Effect, ...], Field(strict=False)] = Field(
        description="what disturbs the detector's readings; an effect that is not named costs nothing"
    )

    @model_validator(mode="after")
    def _is_a_whole_bench(self) -> Scene:
        parts = Counter(device.part for device in self.devices.values())
        faults = [
            f"a bench needs exactly one {needed}, and this one has {parts[needed]}"
            for needed in ("analyzer", "detector")
            if parts[needed] != 1
        ]
        roles = Counter(role for device in self.devices.values() for role in device.roles())
        faults += [
            f"exactly one device must turn {role}, and here {roles[role]} do"
            for role in ("source_arm", "detector_arm", "sample_azimuth")
            if roles[role] != 1
        ]
        faults += [
            f"the effect {effect} is given {count} times; give it once"
            for effect, count in Counter(part.effect for part in self.effects).items()
            if count > 1
        ]
        if self.sample.bounces > 1 and not self.has_acceptance_cone:
            faults.append(
                f"light of {self.sample.bounces} bounces has a pole in the mirror direction, which only the mean over "
                "the detector's cone makes finite; name the effect acceptance_cone, or take bounces: 1"
            )
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def has_acceptance_cone(self) -> bool:
        """Whether the detector takes the mean over its cone of directions."""
        return any(isinstance(part, AcceptanceCone) for part in self.effects)

    @model_validator(mode="after")
    def _material_is_tabulated(self) -> Scene:
        if self.sample.material is not None:
            materials.index(self.sample.material, self.lamp.wavelength_nm)
        return self

    def index(self) -> complex:
        """Refractive index n + ik of the sample at the lamp's wavelength."""
        if self.sample.index is not None:
            return complex(self.sample.index.n, self.sample.index.k)
        assert self.sample.material is not None
        return materials.index(self.sample.material, self.lamp.wavelength_nm)

    def truth(self) -> dict[str, float]:
        """The parameters that a fit of this scene should find: sigma, n, k, weights, and what asymmetry there is."""
        index, sample = self.index(), self.sample
        return {
            "sigma": sample.sigma,
            "n": index.real,
            "k": index.imag,
            **({"asymmetry": sample.asymmetry} if sample.asymmetry else {}),
            "rho_s": sample.rho_s,
            "rho_d": sample.rho_d,
            "rho_dd": sample.rho_dd,
        }

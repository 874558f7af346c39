"""What a surface of a simulated bench is, as a scene describes it."""

from __future__ import annotations

from pydantic import Field, model_validator

from model import materials
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
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

    def index_at(self, wavelength_nm: float) -> complex:
        """Refractive index n + ik at a wavelength."""
        if self.index is not None:
            return complex(self.index.n, self.index.k)
        assert self.material is not None
        return materials.index(self.material, wavelength_nm)

    def surface(self, wavelength_nm: float) -> Surface:
        """The model's surface at a wavelength, made of those lobes whose weight is not zero."""
        index = self.index_at(wavelength_nm)
        lobes = (
            Specular(self.rho_s, self.sigma, index, self.asymmetry, self.bounces),
            Diffuse(self.rho_d, self.sigma),
            Directional(self.rho_dd, self.sigma, index),
        )
        return Surface([lobe for lobe in lobes if lobe.weight > 0])

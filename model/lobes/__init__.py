"""The lobes of Hao et al. 2023, eqs. (5)-(10): each is one addend of the polarimetric reflectance, in 1/sr."""

from __future__ import annotations

from model.lobes.diffuse import Diffuse
from model.lobes.directional import Directional
from model.lobes.lobe import Lobe
from model.lobes.specular import Specular

__all__ = ["Diffuse", "Directional", "Lobe", "Specular"]

"""The table of refractive indices."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose

from model import materials


@pytest.mark.parametrize(
    ("name", "index"),
    [("Fe", 2.950 + 2.932j), ("Al2O3", 1.770), ("soda-lime", 1.525), ("PVC", 1.545), ("Au", 0.424 + 2.472j)],
)
def test_indices_at_550_nm(name: str, index: complex) -> None:
    assert materials.index(name, 550) == index


def test_metals_absorb_and_dielectrics_do_not() -> None:
    metals = {name for name in materials.names() if materials.index(name, 550).imag > 0.0}
    assert metals == {"Fe", "Cr", "Cu", "Au", "Al"}


def test_is_linear_between_the_wavelengths_in_the_table() -> None:
    assert_allclose(materials.index("BK7", 525), (1.52141 + 1.51852) / 2.0, rtol=1e-15)
    # Malitson's formula itself, at a wavelength between two rows.
    assert_allclose(materials.index("fused-silica", 587.56).real, 1.45846, atol=2e-4)


def test_does_not_extrapolate() -> None:
    with pytest.raises(ValueError, match=r"'Fe' at 550 nm only; 632\.8 nm is outside"):
        materials.index("Fe", 632.8)
    with pytest.raises(ValueError, match="'BK7' at 450 nm to 650 nm; 700 nm is outside"):
        materials.index("BK7", 700)
    with pytest.raises(ValueError, match="nan nm is outside"):
        materials.index("Fe", float("nan"))


def test_an_unknown_name_gets_the_nearest_known() -> None:
    with pytest.raises(ValueError, match=r"'sodalime'.*soda-lime"):
        materials.index("sodalime", 550)
    with pytest.raises(ValueError, match=r"'unobtainium'.*Fe, Cr"):
        materials.index("unobtainium", 550)

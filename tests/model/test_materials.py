"""The table of refractive indices."""

from __future__ import annotations

import pytest
from numpy.testing import assert_allclose

from model import materials


@pytest.mark.parametrize(
    ("name", "index"),
    [
        ("Fe", 2.950 + 2.932j),
        ("Au", 0.424 + 2.472j),
        ("brass", 0.527 + 2.765j),
        ("steel", 2.044 + 3.673j),
        ("Al2O3", 1.770),
        ("soda-lime", 1.525),
        ("PVC", 1.545),
        ("PC", 1.5892),
        ("PS", 1.5959),
        ("PTFE", 1.35),
    ],
)
def test_indices_at_550_nm(name: str, index: complex) -> None:
    assert materials.index(name, 550) == index


def test_metals_absorb_and_dielectrics_do_not() -> None:
    metals = {name for name in materials.names() if materials.index(name, 550).imag > 0.0}
    assert metals == {"Fe", "Cr", "Cu", "Au", "Al", "brass", "steel"}


def test_is_linear_between_the_wavelengths_in_the_table() -> None:
    assert_allclose(materials.index("BK7", 525), (1.52141 + 1.51852) / 2.0, rtol=1e-15)
    # Malitson's formula itself, at a wavelength between two rows.
    assert_allclose(materials.index("fused-silica", 587.56).real, 1.45846, atol=2e-4)


@pytest.mark.parametrize(("name", "measured"), [("PMMA", 1.491), ("PC", 1.585), ("PS", 1.592)])
def test_plastics_agree_with_the_measurement_at_the_helium_line(name: str, measured: float) -> None:
    # Sultanova et al. 2009 measured these at 587.6 nm; the rows come from a formula fitted to all their lines.
    assert_allclose(materials.index(name, 587.6), measured, atol=1.5e-3)


def test_a_row_at_550_nm_lies_on_the_line_between_its_neighbours() -> None:
    # Every material has an entry at 550 nm; where it was interpolated it says so, and must not kink the curve.
    for name, below, above in [("Fe", 548.6, 582.1), ("Cr", 548.6, 582.1), ("Al", 516.6, 563.57), ("steel", 540, 560)]:
        share = (550.0 - below) / (above - below)
        line = (1.0 - share) * materials.index(name, below) + share * materials.index(name, above)
        assert_allclose(materials.index(name, 550.0), line, atol=1e-3)


def test_does_not_extrapolate() -> None:
    with pytest.raises(ValueError, match=r"'PTFE' at 550 nm only; 632\.8 nm is outside"):
        materials.index("PTFE", 632.8)
    with pytest.raises(ValueError, match=r"'Fe' at 520\.9 nm to 582\.1 nm; 632\.8 nm is outside"):
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

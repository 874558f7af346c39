"""The single bounce against a table made at 60 digits without the closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from model.vgroove import bounce_mueller

TABLE = Path(__file__).parent.parent / "golden" / "vgroove_single_bounce.csv"


def test_agrees_with_the_reference_to_rounding() -> None:
    rows = np.genfromtxt(TABLE, delimiter=",", names=True, comments="#", skip_header=7)
    assert len(rows) == 81
    for row in rows:
        ti, tr, phi, sigma, n, k, sensitivity, *elements = row.tolist()
        expected = np.reshape(elements, (4, 4))
        computed = bounce_mueller(1, ti, tr, phi, sigma=sigma, asymmetry=0.0, index=complex(n, k))
        tolerance = (1e-12 + 4.0 * sensitivity) * expected[0, 0]
        np.testing.assert_allclose(computed, expected, rtol=0.0, atol=tolerance, err_msg=str(row))

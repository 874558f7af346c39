"""Scans behind a polarizer with a wedge, before a sensor whose pixels differ."""

import numpy as np

WEDGE = [{"effect": "blur", "sigma_px": 0.7}, {"effect": "wedge", "deviation_px": 1.5, "direction_deg": 20}]
UNEVEN = {"electrons_per_count": 5, "read_counts": 4, "dark_counts": 200, "prnu": 0.02}


def test_a_plate_without_structure_has_no_maps_and_says_what_to_do(tmp_path, run_in):
    plate = {"plate": {"size_mm": [200, 200]}}
    asked = {"area": None, "registration": "ecc"}
    maps = run_in(tmp_path, exit_deg=[0, 60], imaging=asked, sensor=UNEVEN, lens=WEDGE, scene=plate).maps()
    assert np.isnan(maps["S0"]).all()
    for note in maps["notes"]:
        assert "shares too little structure" in note
        assert "take registration out of the recipe" in note

"""What `goniometer check` says of a recipe before anything moves."""

import re
import time
from pathlib import Path

import pytest
import yaml

from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe, load_rig
from goniometer.planning import plan

ROOT = Path(__file__).resolve().parents[2]


def variant(folder, zones=None, **changes):
    """The iron recipe with changes, on a rig with collision zones."""
    recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text()) | changes
    rig = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text()) | {"collision_zones": zones or []}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    recipe |= {"rig": "rig.yaml", "scene": str(ROOT / "scenes" / "iron.yaml")}
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in recipe.items() if value is not None}))
    return path


def test_it_tells_travel_data_and_how_long_a_direction_takes(tmp_path):
    """One sweep each way through every slot but one: four slots and dark over 0 to 10 degrees."""
    exits = {"start_deg": 0.0, "stop_deg": 10.0, "step_deg": 1.0}
    said = describe_plan(load_recipe(variant(tmp_path, exit=exits)))
    assert "11 directions, 55 steps, 165 readings" in said
    assert "travel: source arm 60°, detector arm 50°, sample azimuth 0°, analyzer 5 changes of slot" in said
    assert "data: about 16 kB in the journal" in said
    assert re.search(r"the readings of a direction are taken within 0:1\d", said)
    assert re.search(r"0 to 10 +60.000° +0.000° to 10.000° +0.00° +2 ", said)
    assert re.search(r"10 to 0 +60.000° +10.000° to 0.000° +0.00° +3 ", said)
    assert said.endswith("Nothing was moved.")


def test_directions_in_one_go_have_a_line_each_and_references_their_own(tmp_path):
    reference = {"exit_deg": 45.0, "every_points": 2}
    path = variant(tmp_path, exit=None, exit_deg=[0.0, 30.0, 60.0], direction_within_s=0, reference=reference)
    lines = describe_plan(load_recipe(path)).splitlines()
    lines = lines[next(number for number, line in enumerate(lines) if "ends at" in line) + 1 : -2]
    assert [line.endswith("reference") for line in lines] == [True, False, False, True, False, True]
    assert all(re.search(r" 2 3 4 5 6 | 6 5 4 3 2 ", line) for line in lines if not line.endswith("reference"))


def test_every_limit_and_every_way_through_a_zone_is_named_not_only_the_first(tmp_path):
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(variant(tmp_path, exit=None, exit_deg=[-85.0, 0.0, 85.0], azimuth_deg=200, incidence_deg=89))
    assert len(caught.value.faults) == 1, "one axis is beyond its limits"
    boxes = [{"detector_arm": [low, low + 1]} for low in (10.0, 30.0)]
    angles = [float(angle) for angle in range(0, 50, 4)]
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(variant(tmp_path, boxes, exit=None, exit_deg=angles))
    ways = re.findall(r"60/(\d+)/0 to 60/(\d+)/0 degrees", "\n".join(caught.value.faults))
    assert sorted(sorted(map(int, way)) for way in ways) == [[8, 12], [28, 32]]


def test_ways_are_named_that_lead_to_the_reference_or_back_or_only_approach_from_below(tmp_path):
    """The directions themselves are free: between them and the reference there is a part in the way."""
    exits = {"start_deg": 0.0, "stop_deg": 20.0, "step_deg": 10.0}
    reference = {"exit_deg": 60.0, "every_points": 2}
    path = variant(tmp_path, [{"detector_arm": [40.0, 45.0]}], exit=exits)
    assert load_recipe(path)
    with pytest.raises(ConfigurationError, match=r"from .* 60/60/0 to 60/[0-9]+/0 degrees no order of moves"):
        load_recipe(variant(tmp_path, [{"detector_arm": [40.0, 45.0]}], exit=exits, reference=reference))

    below = [{"detector_arm": [-5.0, -1.0]}]
    assert load_recipe(variant(tmp_path, below, exit=exits))
    path = variant(tmp_path, below, exit=exits, reference={"exit_deg": -84.5, "every_points": 2})
    rig = yaml.safe_load((tmp_path / "rig.yaml").read_text())
    rig["devices"]["arms"]["axes"]["detector_arm"]["backlash_deg"] = 2.0
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    with pytest.raises(ConfigurationError, match=r"reference.exit_deg': asks for -84.5 degrees; allowed: -83 to 85"):
        load_recipe(path)
    recipe = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({key: recipe[key] for key in recipe if key != "reference"}))
    with pytest.raises(ConfigurationError, match=r"from .* 60/0/0 to 60/0/0 degrees no order of moves"):
        load_recipe(path)


@pytest.mark.parametrize("more", [{"limits_deg": [-40, 180]}, {"limits_deg": [-52, 180], "backlash_deg": 2.0}])
def test_slots_are_named_that_their_rotator_cannot_reach_or_not_from_below(tmp_path, more):
    rig = yaml.safe_load((ROOT / "rigs" / "simulated_retarder.yaml").read_text())
    rig["devices"]["rotator"]["axes"]["retarder"] |= more
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    with pytest.raises(
        ConfigurationError, match=r"slots\[1\]': turns retarder to -51.7 degrees; allowed: -(40|50) to 180"
    ):
        load_rig(tmp_path / "rig.yaml")


@pytest.mark.parametrize("written", ["exit", "exit_deg"])
def test_a_plan_of_a_hundred_thousand_steps_is_made_soon(tmp_path, written):
    """Within a second of a quiet processor; a loaded one is given three."""
    angles = [round(-85 + 0.0085 * number, 4) for number in range(20000)]
    exits = {"exit": {"start_deg": -85.0, "stop_deg": 84.9915, "step_deg": 0.0085}, "exit_deg": None}
    path = variant(tmp_path, **(exits if written == "exit" else {"exit": None, "exit_deg": angles}))
    begun_s = time.process_time()
    setup = load_recipe(path)
    said = describe_plan(setup)
    assert time.process_time() - begun_s < 3.0
    assert "20000 directions, 100000 steps" in said
    assert len(plan(setup.recipe, setup.rig)) == 100_000

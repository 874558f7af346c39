"""A scene is taken as it is written, or refused with a reason."""

import math

import pytest
from pydantic import TypeAdapter, ValidationError

from sim_devices.effects.known import AnyEffect
from sim_devices.scene import Scene

EFFECT = TypeAdapter(AnyEffect)
BACKLASH = {"effect": "backlash", "axis": "source_arm", "play_deg": 0.05}
ERRORS = {"effect": "slot_angle_errors", "errors_deg": {2: 0.5}}
SHARES = {"effect": "slot_transmissions", "relative": {1: 0.98, 2: 0.9}}


def changed(document, path, value):
    *parents, last = path
    target = document
    for key in parents:
        target = target[key]
    target[last] = value
    return document


def test_a_scene_tells_the_parameters_that_a_fit_should_find(scene_with):
    assert scene_with().truth() == {
        "sigma": 0.1764,
        "n": 2.950,
        "k": 2.932,
        "rho_s": 0.7,
        "rho_d": 0.1,
        "rho_dd": 0.05,
    }


def test_an_index_stands_in_for_a_material(scene_with):
    sample = {"index": {"n": 1.5, "k": 0}, "sigma": 0.2, "rho_s": 1, "rho_d": 0, "rho_dd": 0}
    truth = scene_with(sample=sample, lamp={"power_w": 1e-3, "wavelength_nm": 633}).truth()
    assert (truth["n"], truth["k"]) == (1.5, 0.0)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("sample", "sigma"), "1e-3", "valid number"),
        (("sample", "sigma"), True, "valid number"),
        (("sample", "sigma"), math.nan, "finite"),
        (("sample", "sigma"), 0, "greater than or equal to 0.00001"),
        (("sample", "sigma"), 2.5, "less than or equal to 2"),
        (("sample", "rho_s"), -0.1, "greater than or equal to 0"),
        (("sample", "material"), "Unobtainium", "not known.*Fe"),
        (("sample", "material"), None, "exactly one"),
        (("sample", "index"), {"n": 1.5, "k": 0}, "exactly one"),
        (("sample", "colour"), "red", "Extra inputs"),
        (("lamp", "power_w"), math.inf, "finite"),
        (("lamp", "wavelength_nm"), 1999, "outside"),
        (("seed",), 1.0, "valid integer"),
        (("seed",), -1, "greater than or equal to 0"),
        (("devices", "meter"), {"type": "sr830"}, "sr830"),
        (("devices", "meter", "acceptance_sr"), 0, "greater than 0"),
        (("devices", "sample_stage", "unit"), 32, "less than or equal to 31"),
        (("devices", "sample_stage", "axis"), "source_arm", "exactly one device must turn source_arm"),
        (("devices", "arms", "axes"), {4: "source_arm"}, "less than or equal to 3"),
        (("devices", "arms", "axes"), {1: "source_arm"}, "exactly one device must turn detector_arm"),
        (("devices", "analyzer", "slots"), {1: "open", 2: 0}, "here are 1, 2"),
        (("devices", "analyzer", "slots", 2), "ajar", "open"),
        (("devices", "analyzer", "slots", 2), 200, "less than or equal to 180"),
        (("devices", "second"), {"type": "thorlabs_pm100", "acceptance_sr": 1e-3}, "exactly one detector"),
        (("effects",), [{"effect": "lightning"}], "lightning"),
        (("effects",), [{"effect": "shot_noise"}, {"effect": "shot_noise"}], "given 2 times"),
        (("effects",), [{"effect": "dark_current"}], "Field required"),
        (("effects",), [{"effect": "quantisation", "digits": 0}], "greater than or equal to 1"),
        (("effects",), [BACKLASH, BACKLASH | {"play_deg": 1.0}], "backlash of source_arm is given 2 times"),
        (("effects",), [BACKLASH | {"axis": "sample_azimuth"}], "'source_arm', 'detector_arm' or 'detector_azimuth'"),
        (("effects",), [BACKLASH | {"play_deg": 0.0}], "greater than 0"),
        (("effects",), [BACKLASH | {"play_mm": 0.1}], "Extra inputs"),
        (("effects",), [ERRORS | {"errors_deg": {1: 0.5}}], "slot 1 is open, so it has no angle"),
        (("effects",), [ERRORS | {"errors_deg": {7: 0.5}}], "slot 7 is not on the analyzer, so it has no angle"),
        (("effects",), [ERRORS | {"errors_deg": {}}], "at least 1"),
        (("effects",), [SHARES | {"relative": {6: 0.9}}], "slot 6 is blocked, so it passes no share"),
        (("effects",), [SHARES | {"relative": {9: 0.9}}], "slot 9 is not on the analyzer, so it passes no share"),
        (("effects",), [SHARES | {"relative": {2: 1.1}}], "less than or equal to 1"),
        (("effects",), [{"effect": "extinction_ratio", "ratio": 1.0}], "greater than 1"),
    ],
)
def test_a_fault_is_named(scene_document, path, value, message):
    with pytest.raises(ValidationError, match=message):
        Scene.model_validate(changed(scene_document, path, value))


@pytest.mark.parametrize(
    "path", [("seed",), ("effects",), ("lamp", "power_w"), ("sample", "sigma"), ("sample", "rho_dd"), ("rig",)]
)
def test_nothing_is_assumed_that_was_not_written(scene_document, path):
    *parents, last = path
    target = scene_document
    for key in parents:
        target = target[key]
    del target[last]
    with pytest.raises(ValidationError, match="Field required"):
        Scene.model_validate(scene_document)


def test_a_sample_must_reflect(scene_document):
    scene_document["sample"] |= {"rho_s": 0, "rho_d": 0, "rho_dd": 0}
    with pytest.raises(ValidationError, match="reflects nothing"):
        Scene.model_validate(scene_document)


def test_an_effect_of_one_arm_may_be_given_for_the_other_too(scene_with):
    both = [BACKLASH, BACKLASH | {"axis": "detector_arm"}, ERRORS, SHARES]
    assert len(scene_with(effects=both).effects) == 4


def test_an_analyzer_that_is_no_wheel_has_no_slots_to_be_wrong():
    for effect in (ERRORS, SHARES | {"relative": {1: 0.5}}, {"effect": "wheel_wobble", "stddev_deg": 0.1}):
        (fault,) = EFFECT.validate_python(effect).faults({})
        assert "analyzer" in fault


def test_editors_get_a_schema():
    schema = Scene.model_json_schema()
    assert set(schema["required"]) == {"scene", "rig", "seed", "sample", "lamp", "devices", "effects"}

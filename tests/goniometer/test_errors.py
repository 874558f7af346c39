"""Errors tell the same wherever they come from."""

import pickle

import pytest

from goniometer import errors

DEVICE = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.DeviceError)]


@pytest.mark.parametrize(
    "error",
    [
        *(kind("arms", "it is off", not_done="the move", to_do="switch it on") for kind in DEVICE),
        errors.ConfigurationError(["recipe.yaml: line 3", "recipe.yaml: line 7"]),
        errors.ReductionError("no light"),
        errors.FitError("no data"),
        errors.JournalError("disk full"),
        errors.ScanInterrupted("Ctrl-C", 130),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_comes_whole_out_of_another_process(error):
    error.add_note("All readings are stored.")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)

"""What `import goniometer` promises, and what it costs."""

import subprocess
import sys

import pytest

import goniometer


@pytest.mark.parametrize("name", [name for name in goniometer.__all__ if name != "__version__"])
def test_public_names_are_callable_whatever_was_imported_before(name):
    # a module that had a public name's own name would hide it once imported
    import goniometer.cli
    import goniometer.resume_run
    import goniometer.run_recipe

    assert callable(getattr(goniometer, name))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'sureface'"):
        _ = goniometer.sureface


def test_import_loads_nothing_heavy():
    heavy = ("numpy", "scipy", "cv2", "matplotlib", "xarray", "pandas")
    code = f"import sys, goniometer, goniometer.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

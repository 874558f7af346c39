"""An upper layer may import a lower one, never the other way round."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MAY_IMPORT = {
    "goniometer": {"goniometer", "acquisition", "sim_devices", "drivers", "model"},
    "acquisition": {"acquisition", "drivers", "model", "goniometer.errors"},
    "sim_devices": {"sim_devices", "model", "goniometer.errors"},
    "drivers": {"drivers", "goniometer.errors"},
    "model": {"model", "goniometer.errors"},
}
MODEL_MAY_ALSO_IMPORT = {"numpy", "scipy", "llvmlite"}


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute, so that this test can read them"
            found.add(node.module)
            if node.module == "goniometer":
                found |= {f"goniometer.{alias.name}" for alias in node.names}
    return found


def is_allowed(module: str, allowed: set[str]) -> bool:
    return any(module == name or module.startswith(f"{name}.") for name in allowed)


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_run_down_the_layers(package):
    for path in (ROOT / package).rglob("*.py"):
        for module in imports_of(path):
            if is_allowed(module, set(MAY_IMPORT)):
                assert is_allowed(module, MAY_IMPORT[package]), f"{path.relative_to(ROOT)} imports {module}"


def test_model_needs_only_arrays_and_a_compiler():
    import sys

    allowed = MODEL_MAY_ALSO_IMPORT | MAY_IMPORT["model"] | set(sys.stdlib_module_names)
    for path in (ROOT / "model").rglob("*.py"):
        for module in imports_of(path):
            assert is_allowed(module, allowed), f"{path.relative_to(ROOT)} imports {module}"


def test_a_hidden_package_is_named(tmp_path):
    import subprocess
    import sys

    (tmp_path / "model.py").write_text("")
    done = subprocess.run(
        [sys.executable, "-c", "import goniometer"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert f"{tmp_path / 'model.py'} hides goniometer's package 'model'" in done.stderr
    assert "Rename that file" in done.stderr

"""Compiled kernels on disk: found again by the next process, and never trusted, needed or in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from model.kernel.compiled import cache_folder

ROOT = Path(__file__).resolve().parents[2]
LIGHT = """
from model.lobes import Diffuse
from model.surface import Surface
print(Surface([Diffuse(1.0, 0.3)]).stokes(0.1, 0.2, 0.3).tobytes().hex())
"""
COMPILE_NOTHING = """
from llvmlite.binding import TargetMachine
def refuse(*_): raise AssertionError("compiled anew")
TargetMachine.emit_object = refuse
"""


def run(script: str, folder: Path) -> str:
    """What a process of its own prints."""
    environment = os.environ | {"GONIOMETER_CACHE_DIR": str(folder)}
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert process.returncode == 0, f"{process.returncode}: {process.stderr}"
    return process.stdout


@pytest.fixture(scope="module")
def light(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the kernel computes."""
    return run(LIGHT, tmp_path_factory.mktemp("kernels"))


def test_a_second_process_compiles_nothing(tmp_path: Path) -> None:
    first = run(LIGHT, tmp_path / "not" / "there" / "yet")
    assert run(COMPILE_NOTHING + LIGHT, tmp_path / "not" / "there" / "yet") == first


def test_the_guard_of_the_test_above_holds(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="compiled anew"):
        run(COMPILE_NOTHING + LIGHT, tmp_path)


@pytest.mark.parametrize("damage", ["empty", "cut short", "cut by one byte", "zeros", "noise", "one bit"])
def test_a_damaged_file_is_compiled_anew_and_mended(damage: str, light: str, tmp_path: Path) -> None:
    run(LIGHT, tmp_path)
    (file,) = tmp_path.iterdir()  # and nothing half written
    whole, middle = file.read_bytes(), file.stat().st_size // 4
    file.write_bytes(
        {
            "empty": b"",
            "cut short": whole[: len(whole) // 2],
            "cut by one byte": whole[:-1],
            "zeros": bytes(len(whole)),
            "noise": bytes((byte * 31 + place) % 256 for place, byte in enumerate(whole)),
            "one bit": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
        }[damage]
    )
    assert run(LIGHT, tmp_path) == light
    assert run(COMPILE_NOTHING + LIGHT, tmp_path) == light


@pytest.mark.parametrize("folder", ["a file", "a file/below", "x" * 300])
def test_a_folder_that_cannot_be_is_done_without(folder: str, light: str, tmp_path: Path) -> None:
    (tmp_path / "a file").write_text("in the way")
    assert run(LIGHT, tmp_path / folder) == light


@pytest.mark.skipif(sys.platform == "win32" or os.getuid() == 0, reason="nobody may keep out whom this runs as")
@pytest.mark.parametrize("mode", [0o000, 0o500])
def test_a_folder_that_may_not_be_entered_or_written_is_done_without(mode: int, light: str, tmp_path: Path) -> None:
    (tmp_path / "kernels").mkdir(mode=mode)
    assert run(LIGHT, tmp_path / "kernels") == light


def test_without_a_home_nothing_is_kept(light: str, tmp_path: Path) -> None:
    # What a user without an entry among the users, as in many containers, gets for "~" is "~".
    homeless = """
import os
for name in ("GONIOMETER_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"): os.environ.pop(name, None)
os.path.expanduser = lambda path: path
"""
    assert run(homeless + LIGHT, tmp_path) == light


def test_code_that_is_run_again_belongs_to_its_user_alone(tmp_path: Path) -> None:
    folder = tmp_path / "kernels"
    run(LIGHT, folder)
    if sys.platform != "win32":
        assert folder.stat().st_mode & 0o077 == 0


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="other systems have other places")
def test_the_folder_is_the_users_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("GONIOMETER_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "goniometer" / "kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "goniometer" / "kernels"
    monkeypatch.setenv("GONIOMETER_CACHE_DIR", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"

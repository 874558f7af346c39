from __future__ import annotations

import re
from pathlib import Path

import pytest

from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe, load_rig, load_scene

ROOT = Path(__file__).parents[2]
LOADERS = {"recipe": load_recipe, "rig": load_rig, "scene": load_scene}
BAD_FILES = sorted((ROOT / "tests" / "bad_yaml").glob("*.yaml"))


def expected_faults(path: Path) -> list[tuple[int, str]]:
    head = path.read_text(encoding="latin-1")
    return [(int(line), part) for line, part in re.findall(r"^# expect (\d+): (.+)$", head, re.MULTILINE)]


def test_there_are_enough_broken_files() -> None:
    assert len(BAD_FILES) >= 25


@pytest.mark.parametrize("path", BAD_FILES, ids=lambda path: path.stem)
def test_every_fault_of_a_broken_file_is_reported_once_with_its_line(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    name = path.relative_to(ROOT)
    with pytest.raises(ConfigurationError) as caught:
        LOADERS[path.stem.partition("_")[0]](name)
    faults = list(caught.value.faults)
    for line, part in expected_faults(path):
        hits = [fault for fault in faults if fault.startswith(f"{name}:{line}: ") and part in fault]
        assert len(hits) == 1, f"line {line}: {part!r} not in\n" + "\n".join(caught.value.faults)
        faults.remove(hits[0])
    assert not faults, "more was reported than expected"

"""No command writes over what it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from goniometer.errors import ConfigurationError
from goniometer.output_file import require_output


def test_inputs_and_files_of_a_run_are_not_written_over(tmp_path: Path) -> None:
    table, run = tmp_path / "scan.csv", tmp_path / "run"
    table.write_text("measured", encoding="utf-8")
    run.mkdir()
    (run / "stokes.csv").write_text("measured", encoding="utf-8")
    for target, inputs in ((table, [table]), (run / "stokes.csv", [run]), (tmp_path / "run/../scan.csv", [table])):
        with pytest.raises(ConfigurationError, match="would be lost"):
            require_output(target, (".csv",), inputs)
    with pytest.raises(ConfigurationError, match=r"\.json file"):
        require_output(run / "journal.sqlite", (".json",), [run])
    require_output(tmp_path / "fits.CSV", (".csv", ".parquet"), [table, run])
    require_output(run / "more.csv", (".csv",), [run])

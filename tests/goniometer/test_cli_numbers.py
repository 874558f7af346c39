"""Numbers on the command line that are none are refused before anything is read or opened."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from goniometer.cli import cli

ALIGN = ["align", "--rig", "none.yaml", "--axis", "source_arm"]
OPTIONS = {
    "DEG": ["move", "--rig", "none.yaml", "source_arm"],
    "--exposure": ["read", "--rig", "none.yaml", "--exposure"],
    "--from": [*ALIGN, "--to", "5", "--from"],
    "--to": [*ALIGN, "--from", "1", "--to"],
    "--step": [*ALIGN, "--from", "1", "--to", "5", "--step"],
    "--time": ["budget", "none.yaml", "--design", "out.yaml", "--time"],
    "--speed": ["run", "none.yaml", "--speed"],
}


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e400", "x"])
@pytest.mark.parametrize("option", OPTIONS)
def test_what_is_no_number_is_refused(option, value):
    done = CliRunner().invoke(cli, [*OPTIONS[option], value])
    assert done.exit_code == 2
    assert f"Invalid value for '{option}': " in done.output


@pytest.mark.parametrize("option", ["--exposure", "--step", "--time"])
def test_what_must_be_above_0_is(option):
    done = CliRunner().invoke(cli, [*OPTIONS[option], "0"])
    assert done.exit_code == 2
    assert f"Invalid value for '{option}': 0.0 is not in the range x>0" in done.output

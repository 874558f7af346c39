"""A run in which a person asked for something else than the plan, and that was cut short afterwards."""

import json
import sqlite3
from contextlib import closing

import pytest

from acquisition.journal import FILE_NAME
from acquisition.orders import ORDERED
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.resume import resume


def order(folder, **orders):
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        text = json.dumps({"skipped": [], "exposure_s": None} | orders)
        connection.execute("INSERT INTO about VALUES (?, ?)", (ORDERED, text))
        connection.commit()


def test_an_exposure_that_was_changed_holds_for_the_rest(whole, cut, recipe):
    folder = cut(whole, 20)
    exposure_s = 2 * load_recipe(recipe()).recipe.exposure_s
    order(folder, exposure_s=exposure_s)
    run = resume(folder, speed="max", live_fit=False).run
    before, after = run.readings[:20], run.readings[20:]
    assert {reading.exposure_s for reading in before} == {exposure_s / 2}
    assert {reading.exposure_s for reading in after} == {exposure_s}
    assert run.fit is not None


def test_a_run_with_a_direction_that_was_skipped_is_left_as_it_is(whole, cut, rows):
    folder = cut(whole, 20)
    order(folder, skipped=[1])
    before = rows(folder)
    with pytest.raises(ConfigurationError, match=r"nothing was moved: the rest of point 1 was skipped"):
        resume(folder, speed="max")
    assert rows(folder) == before

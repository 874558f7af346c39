from __future__ import annotations

import pytest

from drivers.wire.reply_text import number, switch, whole_number
from goniometer.errors import ReplyError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12.500000", 12.5),
        ("-0.000500", -0.0005),
        ("1.234205E-03", 1.234205e-3),
        ("+7", 7.0),
        (".5", 0.5),
        ("9.9E+37", 9.9e37),
    ],
)
def test_numbers(text, value):
    assert number("meter", "MEAS:POW?", text) == value


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "1e999", "1_0", "1,5", "0x10", "1.5 W", "1.5\n2", "1e", "٣", "--1", "."]
)
def test_what_is_no_finite_number_is_refused(text):
    with pytest.raises(ReplyError, match=r"meter: the answer to 'MEAS:POW\?' is .* not a number"):
        number("meter", "MEAS:POW?", text)


@pytest.mark.parametrize(("text", "value"), [("3", 3), ("+0", 0), ("-12", -12)])
def test_whole_numbers(text, value):
    assert whole_number("wheel", "pos?", text) == value


@pytest.mark.parametrize("text", ["", "3.0", "three", "3 4", "1_0", "٣"])
def test_what_is_no_whole_number_is_refused(text):
    with pytest.raises(ReplyError, match="not a whole number"):
        whole_number("wheel", "pos?", text)


def test_switches():
    assert [switch("arms", "1MD?", text) for text in ("0", "1")] == [False, True]


@pytest.mark.parametrize("text", ["", "2", "01", "on"])
def test_what_is_neither_on_nor_off_is_refused(text):
    with pytest.raises(ReplyError, match="not 0 or 1"):
        switch("arms", "1MD?", text)

"""The simulated ESP301 speaks the language of its fact sheet."""

import math

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.newport_esp301.stages import STAGES


@pytest.fixture
def source():
    return Axis(0.0005)


@pytest.fixture
def controller(source):
    """Axes 1 and 2 have stages, axis 3 has none; its line takes no time."""
    return NewportEsp301({1: source, 2: Axis(0.0005)}, baudrate=10**12)


@pytest.fixture
def esp(controller):
    return controller.session()


@pytest.fixture
def errors(ask):
    """Empty the error queue."""

    def pop_all(esp, now_s):
        codes = []
        while (code := ask(esp, b"TE?\r", now_s).decode().strip()) != "0":
            codes.append(int(code))
        return codes

    return pop_all


ANSWERS = [
    (b"VE?\r", b"ESP301 Version 3.0.1 6/1/99\r\n"),
    (b"1ID?\r", b"URS150CC, SN1234\r\n"),
    (b"3ID?\r", b", \r\n"),
    (b"1MO?\r", b"0\r\n"),
    (b"1mo;1mo?\r", b"1\r\n"),
    (b"1MO;1MF;1MO?\r", b"0\r\n"),
    (b"1TP\r", b"0.000000\r\n"),
    (b"1TP?\r", b"0.000000\r\n"),
    (b"1DP?\r", b"0.000000\r\n"),
    (b"1TV\r", b"0.000000\r\n"),
    (b"1MD?\r", b"1\r\n"),
    (b" 1 TP ?\r\n", b"0.000000\r\n"),
    (b"\r\n1TP\r\n", b"0.000000\r\n"),
    (b"1TP;2TP\r", b"0.000000\r\n0.000000\r\n"),
    (b"1VA12.5;1VA?\r", b"12.500000\r\n"),
    (b"1VA1.25E1;1VA?\r", b"12.500000\r\n"),
    (b"1VU?\r", b"20.000000\r\n"),
    (b"1AC40;1AG50;1AE60;1AC?;1AG?;1AE?\r", b"40.000000\r\n50.000000\r\n60.000000\r\n"),
    (b"1AU?\r", b"320.000000\r\n"),
    (b"1JK100;1JK?\r", b"100.000000\r\n"),
    (b"1OH4;1JH3;1JW2;1OH?;1JH?;1JW?\r", b"4.000000\r\n3.000000\r\n2.000000\r\n"),
    (b"1SL-5;1SR90;1SL?;1SR?\r", b"-5.000000\r\n90.000000\r\n"),
    (b"1SN?\r", b"7\r\n"),
    (b"1SU?\r", b"0.0005\r\n"),
    (b"1QM?\r", b"1\r\n"),
    (b"1FE?\r", b"1.000000\r\n"),
    (b"1OM4;1OM?\r", b"4\r\n"),
    (b"1MO;1PA10;1PA?\r", b"10.000000\r\n"),
    (b"1MO;1PA10;1PR-2.5;1PA?\r", b"7.500000\r\n"),
    (b"1DH5;1TP\r", b"5.000000\r\n"),
    (b"1DH5;1DH;1TP\r", b"0.000000\r\n"),
    (b"TS\r", b"@\r\n"),
    (b"1MO;TS\r", b"P\r\n"),
    (b"1MO;1PA5;TS\r", b"Q\r\n"),
    (b"1MO;2MO;1PA5;2PA5;TS\r", b"S\r\n"),
    (b"TE?\r", b"0\r\n"),
    (b"TB?\r", b"0, 0, NO ERROR DETECTED\r\n"),
    (b"1XX\rTE?\r", b"6\r\n"),
    (b"WT40;TB?\r", b"0, 100, NO ERROR DETECTED\r\n"),
]


@pytest.mark.parametrize(("command", "answer"), ANSWERS)
def test_commands_are_answered(esp, feed, command, answer):
    assert b"".join(text for _, text in feed(esp, command, trailing=b"1T")) == answer


REFUSALS = [
    (b"1QQ", 6),
    (b"hello", 6),
    (b"1", 6),
    (b"1" * 90, 6),
    (b"TP", 37),
    (b"PA5", 37),
    (b"4TP", 9),
    (b"0TP", 9),
    (b"3PA5", 308),
    (b"3MO", 308),
    (b"1PA", 38),
    (b"1MV", 38),
    (b"1MD", 38),
    (b"1VA", 38),
    (b"WT", 38),
    (b"1PAten", 7),
    (b"1PA1e999", 7),
    (b"1PAnan", 7),
    (b"1MV5", 7),
    (b"1MD?7", 7),
    (b"1OR7", 7),
    (b"1SN12", 7),
    (b"WT-1", 7),
    (b"1PA5", 113),
    (b"1PR5", 113),
    (b"1MV+", 113),
    (b"1OR", 120),
    (b"2PA5", 213),
    (b"1VA20.1", 110),
    (b"1OH21", 110),
    (b"1AC321", 111),
    (b"1AE1000", 111),
    (b"1JK1000000", 115),
    (b"1VA-1", 124),
    (b"1AC0", 101),
    (b"1SN2", 101),
    (b"1SL171", 101),
    (b"1MO;1PA170.5", 106),
    (b"1MO;1PA-170.5", 107),
    (b"1MO;1SR90;1PR91", 106),
    (b"1MO;1OR;1PA5", 130),
    (b"1MO;1OR;1OR", 130),
    (b"1MO;1OR;1ST", 120),
    (b"1MO;1OR;ST", 120),
    (b"1MO;1PA5;1WP6", 101),
    (b"AB", 4),
]


@pytest.mark.parametrize(("command", "code"), REFUSALS)
def test_refusals_are_silent_and_queued(esp, feed, errors, command, code):
    assert feed(esp, command + b"\r", trailing=b"") == []
    assert errors(esp, 0.0) == [code]


def test_a_refused_setting_keeps_its_value(esp, ask):
    ask(esp, b"1VA21;1SR-171;1AC999\r")
    assert ask(esp, b"1VA?;1SR?;1AC?\r") == b"20.000000\r\n170.000000\r\n80.000000\r\n"


def test_a_refused_move_does_not_move(esp, ask):
    ask(esp, b"1PA5;1MO;1PA200\r")
    assert ask(esp, b"1MD?;1TP\r", 10.0) == b"1\r\n0.000000\r\n"


def test_the_error_queue_holds_ten_with_time_and_text(esp, ask, errors):
    ask(esp, b"1PA5\r", 0.4)
    assert ask(esp, b"TB?\r", 1.0) == b"113, 1000, MOTOR NOT ENABLED\r\n"
    for _ in range(12):
        ask(esp, b"TP\r", 2.0)
    assert errors(esp, 3.0) == [37] * 10


def test_a_reply_takes_eight_milliseconds_and_the_next_waits_for_it(esp):
    first, second = esp.receive(b"1TP;2TP\r", 1.0)
    assert_allclose([first[0], second[0]], [1.008, 1.016])
    ((due_s, _),) = esp.receive(b"1TP\r", 5.0)
    assert_allclose(due_s, 5.008)


def test_bytes_take_the_time_of_the_line(source):
    for baudrate in (921_600, 19_200):
        esp = NewportEsp301({1: source}, baudrate=baudrate).session()
        ((due_s, text),) = esp.receive(b"1TP\r", 1.0)
        assert_allclose(due_s, 1.008 + (4 + len(text)) * 10 / baudrate)
        # in one after the other, and so out
        first, second = esp.receive(b"1TP\r1TP\r", 2.0)
        assert_allclose(first[0], 2.008 + (4 + len(text)) * 10 / baudrate)
        assert_allclose(second[0], max(first[0] + len(text) * 10 / baudrate, 2.016 + (4 + len(text)) * 10 / baudrate))


def test_a_move_takes_the_time_of_its_trapezoid(esp, ask, source):
    ask(esp, b"1MO;1VA10;1AC40;1AG20;1PA30\r", 100.0)
    # 30/10 + 10/80 + 10/40 s
    assert ask(esp, b"1MD?\r", 103.37) == b"0\r\n"
    assert ask(esp, b"1MD?;1TP\r", 103.375) == b"1\r\n30.000000\r\n"
    assert source.position_deg(103.375) == 30.0


def test_positions_count_from_where_they_were_defined(esp, ask, source):
    ask(esp, b"1MO;1DH5;1PA12\r")
    assert ask(esp, b"1TP;1PA?;1DP?\r", 5.0) == b"12.000000\r\n" * 3
    assert_allclose(source.position_deg(5.0), 7.0)
    ask(esp, b"1PR-2\r", 6.0)
    assert_allclose(source.position_deg(9.0), 5.0)


def test_velocity_is_told_with_its_sign(esp, ask):
    ask(esp, b"1MO;1PA-60\r")
    assert ask(esp, b"1TV\r", 1.0) == b"-20.000000\r\n"


def test_a_stop_decelerates(esp, ask):
    ask(esp, b"1MO;2MO;1PA60;2PA-60\r")
    ask(esp, b"1ST\r", 1.0)
    # stop: 20²/160 = 2.5 deg beyond 17.5 deg, in 0.25 s
    assert ask(esp, b"1MD?;1TP;1PA?\r", 1.26) == b"1\r\n20.000000\r\n20.000000\r\n"
    assert ask(esp, b"2MD?\r", 1.3) == b"0\r\n"
    ask(esp, b"ST\r", 1.4)
    assert ask(esp, b"2MD?\r", 1.7) == b"1\r\n"


def test_abort_stops_everything_and_takes_the_power(esp, ask, errors):
    ask(esp, b"1MO;2MO;1PA60;2PA60\r")
    ask(esp, b"AB\r", 1.0)
    # emergency deceleration: 320 deg/s², 1/16 s
    assert ask(esp, b"1MD?;2MD?;1MO?;2MO?;1TP\r", 1.0626) == b"1\r\n1\r\n0\r\n0\r\n18.125000\r\n"
    assert errors(esp, 2.0) == [4]


def test_switching_the_motor_off_stops_it(esp, ask):
    ask(esp, b"1MO;1PA60\r")
    ask(esp, b"1MF\r", 1.0)
    assert ask(esp, b"1MD?\r", 1.1) == b"1\r\n"


def test_running_without_target_ends_at_the_software_limit(esp, ask, errors):
    ask(esp, b"1MO;1SR30;1MV+\r")
    assert ask(esp, b"1MD?\r", 1.0) == b"0\r\n"
    assert ask(esp, b"1MD?;1TP;1MO?\r", 5.0) == b"1\r\n30.000000\r\n1\r\n"
    assert errors(esp, 5.1) == [106]


@pytest.mark.parametrize(("command", "end", "code"), [(b"1MT+", b"175", 104), (b"1MT-", b"-175", 105)])
def test_a_limit_switch_stops_the_axis_and_takes_its_power(esp, ask, errors, command, end, code):
    ask(esp, b"1MO;" + command + b"\r")
    assert ask(esp, b"1MD?;1MO?\r", 5.0) == b"0\r\n1\r\n"
    assert ask(esp, b"1MD?;1MO?;1TP\r", 20.0) == b"1\r\n0\r\n" + end + b".000000\r\n"
    assert errors(esp, 21.0) == [code]


def test_a_move_beyond_the_switch_ends_at_it(esp, ask, errors):
    ask(esp, b"1MO;1SR400;1PA300\r")
    assert ask(esp, b"1TP\r", 60.0) == b"175.000000\r\n"
    assert errors(esp, 60.1) == [104]


def test_homing_searches_slowly_and_defines_zero(esp, ask, errors):
    ask(esp, b"1MO;1DH7;1PA67\r")
    ask(esp, b"1OR1\r", 10.0)
    # 60 deg at 5 deg/s, and the search for the index
    assert ask(esp, b"1MD?\r", 32.0) == b"0\r\n"
    assert ask(esp, b"1MD?;1TP\r", 32.1) == b"1\r\n0.000000\r\n"
    assert errors(esp, 33.0) == []


@pytest.mark.parametrize("from_deg", [0, 100, -160])
def test_homing_takes_between_ten_seconds_and_a_minute(esp, ask, from_deg):
    ask(esp, b"1MO;1PA%d\r" % from_deg)
    ask(esp, b"1OR\r", 20.0)
    assert ask(esp, b"1MD?\r", 29.9) == b"0\r\n"
    assert ask(esp, b"1MD?;1TP\r", 80.0) == b"1\r\n0.000000\r\n"


def test_the_encoder_tells_where_the_stage_is_and_the_desired_position_where_it_should_be(esp, ask, source):
    source.position_deg = lambda time_s: source.motor_deg(time_s) + 0.0103
    ask(esp, b"1MO;1PA40\r")
    assert ask(esp, b"1TP;1DP?\r", 1.125) == b"20.010500\r\n20.160000\r\n"
    assert ask(esp, b"1TP;1DP?;1PA?\r", 20.0) == b"40.010500\r\n40.000000\r\n40.000000\r\n"


def test_a_stage_has_its_own_model_encoder_and_speed(ask):
    slow = NewportEsp301({2: Axis(0.001)}, stage=STAGES["SR50CC"]).session()
    told = b"SR50CC, SN1234\r\n0.001\r\n4.000000\r\n4.000000\r\n4.000000\r\n"
    assert ask(slow, b"2ID?;2SU?;2VU?;2VA?;2OH?\r") == told
    assert ask(slow, b"2VA4.1;TE?\r", 1.0) == b"210\r\n"


def test_a_stage_without_switches_turns_on(ask, errors):
    axis = Axis(0.0005)
    esp = NewportEsp301({1: axis}, switches_deg=math.inf).session()
    ask(esp, b"1MO;1SR400;1PA300\r")
    assert ask(esp, b"1MD?;1TP\r", 60.0) == b"1\r\n300.000000\r\n"
    ask(esp, b"1MT-\r", 60.1)
    assert axis.motor_deg(120.0) < -800
    ask(esp, b"1ST\r", 120.0)
    assert errors(esp, 121.0) == []


def test_what_the_firmware_decides_can_be_set(ask):
    esp = NewportEsp301({1: Axis(0.0005)}, line_limit=8, tick_s=1e-3).session()
    assert ask(esp, b"1TP;1TP;;\r1TP;1TP\r", 2.0) == b"0.000000\r\n0.000000\r\n"
    assert ask(esp, b"TB?\r", 3.0) == b"6, 2000, COMMAND DOES NOT EXIST\r\n"


def test_homing_can_be_stopped(esp, ask, errors):
    ask(esp, b"1MO;1PA60\r")
    ask(esp, b"1OR\r", 10.0)
    ask(esp, b"1ST\r", 12.0)
    assert ask(esp, b"1MD?\r", 13.0) == b"1\r\n"
    assert errors(esp, 13.1) == [120]


def test_a_hold_lets_the_next_command_wait_for_the_motion(esp, source):
    ((due_s, text),) = esp.receive(b"1MO;1PA20;1WS500;1PA0;1WS;1TP\r", 0.0)
    # 20/20 + 20/80 s each way
    assert_allclose(due_s, 1.25 + 0.5 + 1.25 + 0.008)
    assert text == b"0.000000\r\n"
    assert_allclose([source.position_deg(time_s) for time_s in (1.25, 1.75, 2.375)], [20, 20, 10])


def test_a_hold_keeps_every_client_waiting(controller, esp):
    esp.receive(b"WT1000\r", 0.0)
    ((due_s, _),) = controller.session().receive(b"1TP\r", 0.1)
    assert_allclose(due_s, 1.008)


def test_a_hold_ends_when_a_position_is_passed(esp):
    ((due_s, text),) = esp.receive(b"1MO;1PA60;1WP30;1TP\r", 0.0)
    assert_allclose(due_s, 30 / 20 + 0.125 + 0.008)
    assert text == b"30.000000\r\n"


@pytest.mark.parametrize(
    ("unit", "position"), [(0, 90_000), (7, 45), (8, 50), (9, 0.785398), (10, 785.398163), (11, 785398.163397)]
)
def test_units_convert_positions(esp, ask, unit, position):
    ask(esp, b"1MO;1PA45;1WS\r")
    assert_allclose(float(ask(esp, b"1SN%d;1TP\r" % unit, 10.0)), position, atol=1e-6)


def test_positions_are_whole_encoder_counts(esp, ask, source):
    ask(esp, b"1MO;1PA10.00037\r")
    assert ask(esp, b"1TP\r", 5.0) == b"10.000500\r\n"
    assert_allclose(source.position_deg(5.0), 10.0005)


def test_reset_takes_power_errors_and_settings_but_keeps_the_position(esp, ask):
    ask(esp, b"1MO;1VA5;1PA10;4TP\r")
    ask(esp, b"RS\r", 10.0)
    assert ask(esp, b"1MO?;1VA?;TE?;1TP\r", 20.0) == b"0\r\n20.000000\r\n0\r\n10.000000\r\n"


def test_state_belongs_to_the_controller_and_unfinished_commands_to_the_client(controller, ask):
    first = controller.session()
    ask(first, b"1MO;1PA12\r1P")
    second = controller.session()
    assert ask(second, b"1TP\r", 5.0) == b"12.000000\r\n"
    assert ask(first, b"A?\r", 6.0) == b"12.000000\r\n"


def test_a_line_without_end_fills_no_memory(esp, ask, errors):
    for _ in range(1000):
        ask(esp, b"x" * 1000)
    assert len(esp._lines._unfinished) < 100
    ask(esp, b"\r")
    assert errors(esp, 0.0) == [6]

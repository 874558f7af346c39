from __future__ import annotations

import select

import pytest

from drivers.axis import Axis
from drivers.newport_esp301.errors import ControllerError, parse_error
from drivers.newport_esp301.stage import NewportEsp301
from drivers.travel import Travel
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

IDENTITY = b"ESP301 Version 3.0.1 6/1/99\r\n"
CLEAN = b"0, 451322, NO ERROR DETECTED\r\n"
ANSWERS = {
    b"VE?": IDENTITY,
    b"TB?": CLEAN,
    b"1ID?": b"URS100CC, SN1234\r\n",
    b"1SN?": b"7\r\n",
    b"1MO?": b"1\r\n",
    b"1TP?": b"12.500000\r\n",
    b"1MD?": b"1\r\n",
}


@pytest.fixture
def arm(make_peer, open_link, clock):
    """Make an axis on a peer that answers as in the table above, changed as asked."""

    def make(reply_timeout_s=2.0, **changes):
        peer = make_peer(ANSWERS | {name.encode() + b"?": answer for name, answer in changes.items()})
        controller = NewportEsp301(open_link(peer.port, "arms", reply_timeout_s), clock)
        stage = controller.stage(1, name="source_arm", velocity_deg_s=20, acceleration_deg_s2=80)
        return peer, controller, Axis(stage, clock, Travel((-5, 90), settle_s=0.05, tolerance_deg=0.005))

    return make


def test_controller_connects_without_moving_and_returns_old_errors(arm):
    peer, controller, _ = arm(TB=[b"6, 5, COMMAND DOES NOT EXIST\r\n", b"213, 9, AXIS-2 MOTOR NOT ENABLED\r\n", CLEAN])
    assert controller.connect() == ("error 6, command does not exist", "error 213, motor not enabled (axis 2)")
    assert peer.commands == [b"WT0", b"VE?", b"TB?", b"TB?", b"TB?"]


def test_axis_connects_without_moving(arm):
    peer, controller, axis = arm()
    controller.connect()
    axis.connect()
    assert peer.commands == [
        *(b"WT0", b"VE?", b"TB?", b"1ID?", b"1SN?"),
        *(b"1VA20.000000", b"1AC80.000000", b"1AG80.000000", b"1MO", b"TB?", b"1MO?"),
    ]
    assert (axis.name, axis.settle_s, axis.tolerance_deg) == ("source_arm", 0.05, 0.005)


def test_other_device_on_the_port_is_refused(arm):
    _, controller, _ = arm(VE=b"COMMAND ERROR\r\n" * 40)
    with pytest.raises(
        ReplyError, match=r"arms: the answer to 'VE\?' is 'COMMAND ERROR', .* identity with ESP30 in it"
    ):
        controller.connect()


def test_axis_in_millimetres_is_refused_before_anything_is_set(arm):
    peer, _, axis = arm(**{"1SN": b"2\r\n"})
    with pytest.raises(DeviceFaultError, match="source_arm: axis 1 of the controller counts in unit 2, not in degrees"):
        axis.connect()
    assert peer.commands == [b"1ID?", b"1SN?"]


@pytest.mark.parametrize("answer", [b"\r\n", b" , \r\n"])
def test_axis_without_a_stage_is_refused(arm, answer):
    _, _, axis = arm(**{"1ID": answer})
    with pytest.raises(DeviceFaultError, match="source_arm: there is no stage at axis 1"):
        axis.connect()


def test_axis_that_does_not_exist_is_told_from_a_silent_controller(arm):
    peer, _, axis = arm(reply_timeout_s=0.05, **{"1ID": b"", "TB": [b"9, 5, AXIS NUMBER OUT OF RANGE\r\n", CLEAN]})
    with pytest.raises(DeviceFaultError, match="error 9, axis number out of range"):
        axis.connect()
    assert b"1MO" not in peer.commands


def test_refused_velocity_and_motor_that_stays_off_are_faults(arm):
    _, _, axis = arm(TB=[b"110, 5, AXIS-1 MAXIMUM VELOCITY EXCEEDED\r\n", CLEAN])
    with pytest.raises(
        DeviceFaultError, match="source_arm: the controller reports error 110, maximum velocity exceeded"
    ):
        axis.connect()
    _, _, axis = arm(**{"1MO": b"0\r\n"})
    with pytest.raises(DeviceFaultError, match=r"source_arm: the motor is off: .* emergency stop"):
        axis.connect()


def test_move_sends_the_target_and_asks_for_errors(arm):
    peer, _, axis = arm(**{"1MD": [b"0\r\n", b"0\r\n", b"1\r\n"]})
    axis.start_move(60)
    assert peer.commands == [b"1TP?", b"1PA60", b"TB?"]
    assert [axis.is_moving(), axis.is_moving(), axis.is_moving()] == [True, True, False]
    assert peer.commands[3:] == [b"1MD?", b"1MD?", b"1MD?", b"TB?", b"1MO?"]


def test_controller_that_was_reset_in_motion_is_not_taken_to_have_arrived(arm):
    # its motor is off and it counts from 0 where it stands, which here is the target
    _, _, axis = arm(**{"1TP": [b"12.500000\r\n", b"0.000000\r\n"], "1MO": b"0\r\n"})
    axis.start_move(0)
    with pytest.raises(DeviceFaultError, match=r"source_arm: the motor is off: its controller was reset"):
        axis.is_moving()


def test_controller_that_was_reset_while_its_link_was_lost_is_not_set_up_again(arm):
    """Its motor is off; switched on, it would count from where it stands."""
    peer, _, axis = arm(**{"1MO": [b"1\r\n", b"0\r\n"]})
    axis.connect()
    axis.reconnect()
    sent = len(peer.commands)
    with pytest.raises(DeviceFaultError, match=r"the motor is off: .* Not done: the axis was not set up again"):
        axis.connect()
    assert b"1MO" not in peer.commands[sent:]


def test_another_stage_at_the_connector_is_not_taken_for_the_one_before(arm):
    peer, _, axis = arm(**{"1ID": [b"URS100CC, SN1234\r\n", b"URS100CC, SN1235\r\n"]})
    axis.connect()
    axis.reconnect()
    sent = len(peer.commands)
    with pytest.raises(DeviceFaultError, match=r"source_arm: another device answers .*SN1235.*SN1234"):
        axis.connect()
    assert not [command for command in peer.commands[sent:] if command.startswith(b"1VA")]


def test_home_search_is_the_controllers_own_and_is_waited_for(arm):
    peer, _, axis = arm(**{"1MD": [b"0\r\n", b"1\r\n"]})
    axis.start_homing()
    assert [axis.is_moving(), axis.is_moving()] == [True, False]
    assert peer.commands == [b"1OR", b"TB?", b"1MD?", b"1MD?", b"TB?", b"1MO?"]


@pytest.mark.parametrize("target_deg", [90.001, -5.001, float("nan"), float("inf")])
def test_target_outside_the_limits_is_refused_before_the_first_byte(arm, target_deg):
    peer, _, axis = arm()
    with pytest.raises(LimitError, match=r"source_arm: the target .* is outside the limits -5 to 90 degrees"):
        axis.start_move(target_deg)
    assert axis.position_deg() == 12.5
    assert peer.commands == [b"1TP?"]


@pytest.mark.parametrize("target_deg", [-5, 90])
def test_the_limits_themselves_are_allowed(arm, target_deg):
    peer, _, axis = arm()
    axis.start_move(target_deg)
    assert b"1PA%d" % target_deg in peer.commands


@pytest.mark.parametrize(
    ("report", "said"),
    [(b"106, 1, AXIS-1 X\r\n", "positive software limit"), (b"113, 1, AXIS-1 X\r\n", "motor not enabled")],
)
def test_move_that_the_controller_refuses_is_reported_at_once(arm, report, said):
    _, _, axis = arm(TB=[report, CLEAN])
    with pytest.raises(
        DeviceFaultError, match=f"source_arm: .*{said}.* Not done: the move of source_arm to 60 degrees"
    ):
        axis.start_move(60)


def test_fault_during_the_motion_is_raised_when_it_ends(arm):
    _, _, axis = arm(TB=[CLEAN, b"103, 1, AXIS-1 FOLLOWING ERROR\r\n", CLEAN])
    axis.start_move(60)
    with pytest.raises(DeviceFaultError, match="following error threshold exceeded"):
        axis.is_moving()


def test_fault_names_the_axis_it_belongs_to(arm):
    _, controller, axis = arm(TB=[b"203, 1, AXIS-2 FOLLOWING ERROR\r\n", CLEAN])
    controller.stage(2, name="detector_arm", velocity_deg_s=20, acceleration_deg_s2=80)
    with pytest.raises(DeviceFaultError, match=r"detector_arm: the controller reports error 203, .* \(axis 2\)"):
        axis.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_motion_has_twice_its_duration_and_five_seconds(arm, clock):
    _, _, axis = arm(**{"1MD": b"0\r\n", "1TP": [b"12.5\r\n", b"20.0\r\n", b"30.0\r\n"]})
    axis.start_move(60)
    expected_s = 47.5 / 20 + 20 / 80
    clock.time_s = 2 * expected_s + 5 - 1e-6
    assert axis.is_moving()
    clock.time_s += 2e-6
    with pytest.raises(DeviceFaultError, match="source_arm: the motion to 60 degrees has not ended"):
        axis.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_motion_that_ended_while_the_host_hung_is_good(arm, clock):
    _, _, axis = arm()
    axis.start_move(60)
    clock.time_s = 1e6
    assert not axis.is_moving()


@pytest.mark.parametrize("answer", [b"nan\r\n", b"ESP301\r\n", b"\xff\xfe\r\n", b"1.0 2.0\r\n"])
def test_garbage_position_is_refused(arm, answer):
    _, _, axis = arm(**{"1TP": answer})
    with pytest.raises(ReplyError, match=r"source_arm: the answer to '1TP\?'"):
        axis.position_deg()


def test_garbage_motion_state_is_refused(arm):
    _, _, axis = arm(**{"1MD": b"2\r\n"})
    with pytest.raises(ReplyError, match="not 0 or 1"):
        axis.is_moving()


def test_lines_without_an_answer_are_ten_milliseconds_apart(arm, clock):
    _, _, axis = arm()
    axis.stop()
    assert clock.time_s == pytest.approx(0.02)


def test_search_for_home_that_was_aborted_by_nobody_here_is_a_fault(arm):
    _, _, axis = arm(TB=[CLEAN, b"120, 5, AXIS-1 HOMING ABORTED\r\n", CLEAN])
    axis.start_homing()
    with pytest.raises(DeviceFaultError, match="source_arm: the controller reports error 120, homing aborted"):
        axis.is_moving()


def test_stop_needs_no_answer_may_be_repeated_and_interrupts_an_exchange(arm, until):
    peer, _, axis = arm(reply_timeout_s=0.05, **{"1TP": b""})
    with pytest.raises(ReplyTimeoutError, match="1TP"):
        axis.position_deg()
    axis.stop()
    axis.stop()
    until(lambda: peer.commands[-4:] == [b"WT0", b"1ST", b"WT0", b"1ST"])


def test_command_sent_in_part_neither_becomes_a_motion_nor_swallows_the_stop(arm, until):
    peer, controller, axis = arm()
    controller._link.write(b"2PA45.")
    axis.stop()
    until(lambda: peer.commands == [b"2PA45.WT0", b"1ST"])


def test_stop_opens_a_lost_link_once_more(arm, until):
    peer, controller, axis = arm()
    controller.connect()
    peer.vanish()
    until(lambda: bool(select.select([controller._link], [], [], 0)[0]))
    axis.stop()
    until(lambda: peer.commands[-2:] == [b"WT0", b"1ST"])
    assert peer.connections == 2
    assert axis.position_deg() == 12.5


def test_stop_on_a_link_that_was_found_lost_before_reaches_the_controller_too(arm, until):
    peer, controller, axis = arm()
    controller.connect()
    peer.vanish()
    with pytest.raises(NotConnectedError, match="is gone"):
        axis.is_moving()
    axis.stop()
    until(lambda: peer.commands[-2:] == [b"WT0", b"1ST"])


def test_stop_that_cannot_be_sent_tells_to_cut_the_power(arm, until):
    peer, controller, axis = arm()
    controller.connect()
    peer.close()
    until(lambda: bool(select.select([controller._link], [], [], 0)[0]))
    with pytest.raises(
        NotConnectedError,
        match=r"source_arm: .* may still be moving\. What to do: cut its power or press the emergency stop now",
    ):
        axis.stop()


def test_late_answer_is_not_taken_for_the_next_one(arm):
    peer, _, axis = arm(
        reply_timeout_s=0.05, **{"1TP": [b"", b"34.000000\r\n"], "VE": b"12.500000\r\n" + ANSWERS[b"VE?"]}
    )
    assert axis.position_deg() == 34.0
    assert peer.commands == [b"1TP?", b"WT0", b"VE?", b"1TP?"]


def test_many_late_answers_are_dropped(arm):
    peer, _, axis = arm(
        reply_timeout_s=0.05, **{"1TP": [b"", b"34.000000\r\n"], "VE": b"12.500000\r\n" * 20 + IDENTITY}
    )
    assert axis.position_deg() == 34.0
    assert peer.commands == [b"1TP?", b"WT0", b"VE?", b"1TP?"]


def test_late_identity_does_not_put_answers_one_question_behind(arm):
    answers = {"1TP": [b"", b"34.000000\r\n", b"35.000000\r\n"], "VE": [b"", b"12.500000\r\n" + 2 * IDENTITY]}
    _, _, axis = arm(reply_timeout_s=0.05, **answers)
    assert [axis.position_deg(), axis.position_deg()] == [34.0, 35.0]


def test_an_identity_that_was_lost_for_good_does_not_leave_answers_out_of_step_for_ever(arm):
    peer, _, axis = arm(reply_timeout_s=0.05, **{"1TP": [b"", b"34.000000\r\n"], "VE": [b"", IDENTITY]})
    assert [axis.position_deg(), axis.position_deg()] == [34.0, 34.0]
    assert peer.commands == [b"1TP?", b"WT0", b"VE?", b"WT0", b"VE?", b"1TP?", b"1TP?"]


def test_an_identity_that_comes_after_all_is_not_taken_for_an_answer(arm, until):
    peer, controller, axis = arm(reply_timeout_s=0.05, **{"1TP": [b"", b"34.000000\r\n"], "VE": [b"", IDENTITY]})
    assert axis.position_deg() == 34.0
    peer.say(IDENTITY)
    until(controller._link.has_input)
    assert axis.position_deg() == 34.0
    assert peer.commands[-3:] == [b"WT0", b"VE?", b"1TP?"]


@pytest.mark.parametrize("question", ["1TP", "1MD", "1SN", "1ID"])
def test_answer_that_is_none_is_asked_for_again_once_answers_are_proven(arm, question):
    usable = ANSWERS[question.encode() + b"?"]
    peer, _, axis = arm(**{question: [b"3.5.7\r\n", usable]})
    {"1TP": axis.position_deg, "1MD": axis.is_moving}.get(question, axis.connect)()
    asked = peer.commands.index(question.encode() + b"?")
    assert peer.commands[asked + 1 : asked + 4] == [b"WT0", b"VE?", question.encode() + b"?"]


def test_error_report_that_is_none_is_not_asked_for_again_because_that_would_take_the_next_one(arm):
    peer, controller, _ = arm(TB=[b"3.5.7\r\n", CLEAN])
    with pytest.raises(ReplyError, match="TB"):
        controller.raise_errors("nothing")
    assert peer.commands == [b"TB?"]
    controller.raise_errors("nothing")
    assert peer.commands == [b"TB?", b"WT0", b"VE?", b"TB?"]


def test_line_that_nobody_asked_for_is_not_an_answer(arm, until):
    peer, controller, axis = arm()
    controller.connect()
    peer.say(b"99.000000\r\n")
    until(controller._link.has_input)
    assert axis.position_deg() == 12.5


def test_connects_behind_a_line_that_another_program_left_unfinished(arm):
    peer, controller, _ = arm()
    controller._link.write(b"1PA4")
    controller.connect()
    assert peer.commands == [b"1PA4WT0", b"VE?", b"TB?"]


def test_error_queue_without_an_end_is_refused(arm):
    peer, controller, _ = arm(TB=b"6, 5, COMMAND DOES NOT EXIST\r\n")
    with pytest.raises(ReplyError, match="end of a queue of ten errors"):
        controller.connect()
    assert peer.commands.count(b"TB?") == 11


def test_full_error_queue_is_read_to_its_end(arm):
    _, controller, _ = arm(TB=[b"6, 5, COMMAND DOES NOT EXIST\r\n"] * 10 + [CLEAN])
    assert len(controller.connect()) == 10


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("0, 451322, NO ERROR DETECTED", None),
        ("6, 1, COMMAND DOES NOT EXIST", ControllerError(6, None, "command does not exist")),
        ("303,1,FOLLOWING ERROR", ControllerError(303, 3, "following error threshold exceeded")),
        ("208, 1, X", ControllerError(208, 2, "motor or stage not connected")),
        ("199, 1, SOMETHING NEW", ControllerError(199, 1, "something new")),
    ],
)
def test_error_reports(line, error):
    assert parse_error("arms", line) == error


@pytest.mark.parametrize("line", ["", "0", "12.5", "a, b, c", "0, 451322,"])
def test_malformed_error_reports_are_refused(line):
    with pytest.raises(ReplyError, match="not an error report"):
        parse_error("arms", line)

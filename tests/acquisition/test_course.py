"""The steps of a planned scan, up to the end of one direction after the other."""

from acquisition.course import Listed
from acquisition.expand import Step, Target


def step(point, slot, kind="signal"):
    return Step(point, kind, Target(60.0, float(point), 0.0, slot), 0.0, 1, 0.03, 1.0)


def test_steps_end_with_a_direction_wherever_it_began():
    """Two blocks of two directions and two slots, and a reference that closes the scan."""
    steps = [step(point, slot) for point, slot in ((0, 2), (1, 2), (1, 3), (0, 3), (2, 3), (3, 3), (3, 2), (2, 2))]
    steps.append(step(2, 1, "reference"))
    way, taken, ends = Listed(steps), [], []
    assert way.ahead == steps[0].target
    while part := way.next(()):
        taken += part
        ends.append(part[-1].point)
        assert way.ahead == (steps[len(taken)].target if len(taken) < len(steps) else None)
    assert taken == steps
    assert ends == [1, 0, 3, 2]

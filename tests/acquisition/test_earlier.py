"""From where a scan is taken up: the places that tell from which side to come."""

from acquisition.earlier import way_to
from acquisition.steps import Target


def at(incidence_deg, exit_deg, slot, azimuth_deg=0.0, generator=None):
    return Target(incidence_deg, exit_deg, azimuth_deg, slot, generator=generator)


def test_every_axis_comes_from_where_it_came_last():
    way = way_to([at(30, 0, 1), at(60, 0, 1), at(60, 10, 1), at(60, 10, 2), at(60, 0, 2), at(60, 0, 3), at(60, 0, 3)])
    assert way == (at(30, 0, 1), at(60, 10, 2), at(60, 0, 2), at(60, 0, 3))


def test_a_generator_comes_from_where_it_came_last():
    places = [at(60, 0, slot, generator=generator) for slot, generator in ((1, 1), (1, 2), (2, 2), (3, 2), (4, 2))]
    assert way_to(places) == (places[0], places[3], places[4])


def test_what_never_turned_wants_no_place():
    assert way_to([at(60, 0, 1)]) == (at(60, 0, 1),)
    assert way_to([at(60, 0, 1)] * 3) == (at(60, 0, 1),)
    assert way_to([]) == ()

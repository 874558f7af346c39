"""A watchdog that counts looks: it barks at a scan that hangs, and at no other."""

import threading

from acquisition.watchdog import Watchdog


def test_it_barks_after_its_limit_of_silence_and_once():
    heard = []
    watchdog = Watchdog(20.0, heard.append)
    watchdog.feed()
    looks = 1
    while not watchdog.look():
        looks += 1
    assert heard == [20.0]
    assert looks * watchdog.look_s == 22.0  # the first look sees the last feeding


def test_it_is_silent_while_the_scan_goes_on_however_rarely():
    heard = []
    watchdog = Watchdog(20.0, heard.append)
    for look in range(1000):
        if look % 9 == 0:
            watchdog.feed()
        assert not watchdog.look()
    assert heard == []


def test_its_thread_barks_while_the_other_one_hangs():
    heard = threading.Event()
    with Watchdog(0.2, lambda silent_s: heard.set()):
        assert heard.wait(10.0)


def test_its_thread_ends_with_the_scan():
    before = threading.active_count()
    with Watchdog(20.0, lambda silent_s: None) as watchdog:
        assert threading.active_count() == before + 1
        watchdog.feed()
    assert threading.active_count() == before

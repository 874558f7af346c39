"""Drives a bench's APT controllers with thorlabs-apt-device; run in the environment of requirements.txt.

Arguments: the pseudo-terminals of a KDC101 and of a BSC201. Prints one JSON object.
"""

import json
import sys
import time

from thorlabs_apt_device import BSC201, KDC101


def wait_until(state, *, what):
    """Read what the client's own thread has been told, until it is so."""
    for _ in range(2000):
        if state():
            return
        time.sleep(0.005)
    raise TimeoutError(f"the controller has not told of {what}")


def turn(controller, counts_per_deg, velocity, acceleration):
    """Home, go to 12.5 deg, then 20 deg back, and stop on a way without end."""
    status, found = controller.status_[0][0], {}
    wait_until(lambda: status["channel_enabled"], what="its channel")
    controller.set_velocity_params(acceleration=acceleration, max_velocity=velocity)
    wait_until(lambda: controller.velparams_[0][0]["max_velocity"] == velocity, what="its velocity")
    found["homed at first"] = status["homed"]
    controller.home()
    wait_until(lambda: status["homed"] and not status["homing"], what="home")
    for name, move, way in (
        ("position", controller.move_absolute, 12.5),
        ("other position", controller.move_relative, -20.0),
    ):
        start = status["position"]
        move(round(way * counts_per_deg))
        wait_until(lambda start=start: status["position"] != start and status["settled"], what="the move's end")
        found[name] = status["position"] / counts_per_deg
    controller.move_velocity(direction="forward")
    wait_until(lambda: status["moving_forward"] or status["moving_reverse"], what="motion")
    controller.stop()
    wait_until(lambda: status["settled"], what="the stop")
    found["stopped"] = status["position"] / counts_per_deg
    return found


def main(kdc101, bsc201):
    servo, rack = KDC101(kdc101, home=False), BSC201(bsc201, home=False)
    return {"KDC101": turn(servo, 1919.6419, 858_833, 293), "BSC201": turn(rack, 75091, 80_617_700, 41_300)}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))

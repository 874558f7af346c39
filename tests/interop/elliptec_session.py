"""Drives a bench's Elliptec modules with elliptec; run in the environment of requirements.txt.

Arguments: the path of the modules' pseudo-terminal, a rotator's address and a slider's. Prints one JSON object.
"""

import json
import sys

from elliptec import Controller, Rotator, Slider


def main(port, rotator_address, slider_address):
    controller = Controller(port)
    rotator = Rotator(controller, address=rotator_address)
    found = {"type": rotator.motor_type, "range": rotator.range, "pulses": rotator.pulse_per_rev}
    rotator.home()
    found["angles"] = [rotator.set_angle(45), rotator.get_angle(), rotator.shift_angle(-90), rotator.get_angle()]
    rotator.set("stepsize", rotator.angle_to_pos(10))
    rotator.move("forward")
    found["jogged"] = rotator.get_angle()
    found["motor"] = rotator.get("motor_1_info")["Current"]
    found["no number"] = rotator.send_instruction(b"ma", message="0000XYZ0")
    found["status"] = [rotator.get("status"), rotator.get("status")]
    rotator.change_address("7")
    found["at another address"] = [rotator.address, rotator.get_angle()]
    slider = Slider(controller, address=slider_address)
    slider.home()
    found["slots"] = [slider.set_slot(3), slider.get_slot(), slider.jog("backward"), slider.get_slot()]
    controller.close_connection()
    return found


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))

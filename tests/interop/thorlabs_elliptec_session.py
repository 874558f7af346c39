"""Drives the Elliptec modules of a bench with thorlabs-elliptec; run in the environment of requirements.txt.

Arguments: the path of the modules' pseudo-terminal, and their addresses. Prints one JSON object.
"""

import json
import sys

from thorlabs_elliptec import ELLx


def drive(module):
    found = {"model": module.model_number, "units": module.units}
    module.home(blocking=True)
    found["home"] = module.get_position()
    if module.travel == 360:
        module.move_absolute(45.0, blocking=True)
        found["position"] = module.get_position()
        module.move_relative(-90.0, blocking=True)
        found["other position"] = module.get_position()
    else:
        module.move_absolute_raw(0x20, blocking=True)
        found["position"] = module.get_position_raw()
    found["status"] = str(module.status)
    return found


def main(port, addresses):
    modules = {}
    for address in addresses:
        # the second and later modules share the port that the first one has opened
        shared = next(iter(modules.values()), port)
        modules[address] = ELLx(serial_port=shared, device_id=int(address, 16))
    found = {address: drive(module) for address, module in modules.items()}
    for module in modules.values():
        module.close()
    return found


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], sys.argv[2:])))

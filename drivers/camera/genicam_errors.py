"""What can go wrong with a GenICam camera, in words."""

from __future__ import annotations

from collections.abc import Sequence

from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyTimeoutError


def not_installed(name: str) -> NotConnectedError:
    """The library is optional."""
    return NotConnectedError(
        name,
        "GenICam cameras need the library harvesters, which is not installed",
        not_done="the camera was not opened",
        to_do="pip install 'goniometer[genicam]'",
    )


def no_transport_library(name: str, path: str) -> NotConnectedError:
    """The maker's library is not where the rig file says."""
    return NotConnectedError(
        name,
        f"there is no transport library {path}",
        not_done="the camera was not opened",
        to_do="install the software of the camera's maker, and write the path of its .cti file as transport_library",
    )


def not_there(name: str, serial_number: str, others: Sequence[str]) -> NotConnectedError:
    """Another camera, or none."""
    return NotConnectedError(
        name,
        f"no camera has the serial number {serial_number}; there are {', '.join(others) or 'none'}",
        not_done="the camera was not opened",
        to_do="look at its cable and power, at port in the rig file, which is its serial number, and whether another "
        "program uses it",
    )


def gone(name: str, error: str, not_done: str) -> NotConnectedError:
    """The transport library has failed."""
    return NotConnectedError(
        name,
        f"the camera's transport library says: {error}",
        not_done=not_done,
        to_do="look at its cable and power, and whether another program uses it; then run the recipe again",
    )


def no_feature(name: str, feature: str) -> DeviceFaultError:
    """Something that every camera here must have."""
    return DeviceFaultError(
        name,
        f"the camera has no {feature}",
        not_done="it was not set up",
        to_do="use another camera: without it this one cannot be controlled",
    )


def not_taken(name: str, feature: str, value: str | float, why: str) -> DeviceFaultError:
    """A setting that the camera does not have."""
    return DeviceFaultError(
        name,
        f"the camera did not take {feature} = {value}: {why}",
        not_done="no picture was taken",
        to_do="change what the rig file says of it to what the camera has; what it does not say, change with the "
        "maker's software",
    )


def impossible_exposure(name: str, exposure_s: float, least_s: float, most_s: float) -> LimitError:
    """Outside of the camera's limits."""
    return LimitError(
        name,
        f"an exposure of {exposure_s:g} s is not between {least_s:g} and {most_s:g} s",
        not_done="the picture was not begun",
        to_do="change exposure_s in the recipe",
    )


def other_exposure(name: str, exposure_s: float, held_s: float) -> LimitError:
    """Between two that the camera has."""
    return LimitError(
        name,
        f"the camera made {held_s:g} s of an exposure of {exposure_s:g} s",
        not_done="the picture was not begun",
        to_do="write an exposure_s that the camera has, or switch off what limits it, such as a fixed rate",
    )


def overdue(name: str, exposure_s: float) -> ReplyTimeoutError:
    """No picture, and no error either."""
    return ReplyTimeoutError(
        name,
        f"the picture of an exposure of {exposure_s:g} s has not come in more than twice the time",
        not_done="the reading was not finished",
        to_do="look at its cable and power, and switch off an external trigger",
    )


def dropped(name: str, attempts: int) -> DeviceFaultError:
    """No picture came whole."""
    return DeviceFaultError(
        name,
        f"pictures were lost or came incomplete in each of {attempts} attempts at a reading",
        not_done="the reading was thrown away",
        to_do="use a faster port or cable, jumbo packets on Ethernet, or a longer delay between packets",
    )


def not_an_image(name: str, values: int, width: int, height: int) -> DeviceFaultError:
    """Packed, padded or in colours."""
    return DeviceFaultError(
        name,
        f"a picture of {width} x {height} pixels came with {values} values",
        not_done="the picture was not used",
        to_do="set the camera to one of Mono8 to Mono16, unpacked and without padding",
    )


def other_picture(name: str, found: str, wanted: str) -> DeviceFaultError:
    """Not what the camera was set to."""
    return DeviceFaultError(
        name,
        f"a picture of {found} came, where the camera was set to {wanted}",
        not_done="the picture was not used",
        to_do="see who changes the camera's settings, and run the recipe again",
    )

"""What can go wrong with a video, in words."""

from __future__ import annotations

from collections.abc import Sequence

from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyTimeoutError

_CABLES = (
    "look at the camera's cable, power and address, and whether another program uses it; then run the recipe again"
)
_FASTER = "use a faster cable or network, a smaller picture or a lower rate, and close what else uses the computer"


def not_opened(name: str, address: str, is_file: bool) -> NotConnectedError:
    """It is not there, or OpenCV cannot read it."""
    return NotConnectedError(
        name,
        f"OpenCV cannot open {address} as a video",
        not_done="no picture was taken",
        to_do="check that the file is there and is a video" if is_file else _CABLES,
    )


def lost(name: str, address: str, frames: int) -> NotConnectedError:
    """A camera has gone."""
    return NotConnectedError(
        name,
        f"{address} gives no more pictures, after {frames}: the stream ended or stood still, or what came could not "
        "be decoded",
        not_done="the reading was not finished",
        to_do=_CABLES,
    )


def file_ended(name: str, address: str, frames: int) -> DeviceFaultError:
    """A file holds fewer pictures than the scan needs."""
    return DeviceFaultError(
        name,
        f"the video file {address} has ended, after {frames} pictures",
        not_done="the reading was not finished",
        to_do="record a longer video, or take fewer or shorter readings: each picture is used once",
    )


def overdue(name: str, address: str, exposure_s: float, frames: int, wanted: int, lost: int) -> ReplyTimeoutError:
    """Too few pictures in the time."""
    others = f", {lost} others were missing or damaged" if lost else ""
    return ReplyTimeoutError(
        name,
        f"of the {wanted} pictures of a reading of {exposure_s:g} s only {frames} have come from {address} in more "
        f"than twice the time{others}",
        not_done="the reading was not finished",
        to_do=_FASTER if lost else _CABLES,
    )


def crashed(name: str, error: BaseException) -> DeviceFaultError:
    """Nobody takes the pictures any more."""
    return DeviceFaultError(
        name,
        f"taking pictures failed: {type(error).__name__}: {error}",
        not_done="no more pictures are taken",
        to_do="run the recipe again; if it happens again, report it with this message",
    )


def not_set(name: str, refused: Sequence[str]) -> DeviceFaultError:
    """The camera does not do what the rig file says."""
    return DeviceFaultError(
        name,
        f"the camera did not take its settings: {', '.join(refused)}",
        not_done="no picture was taken",
        to_do="change settings in the rig file to values that the camera has, in the units of its driver, or leave "
        "them out",
    )


def other_size(name: str, found: tuple[int, ...], wanted: tuple[int, int]) -> DeviceFaultError:
    """A picture that does not fit the others."""
    return DeviceFaultError(
        name,
        f"a picture of {' x '.join(map(str, found))} pixels came, where they should have {wanted[0]} x {wanted[1]}",
        not_done="the picture was not used, and no more are taken",
        to_do="see who changes the camera's settings, and run the recipe again",
    )


def not_8_bits(name: str, found: str) -> DeviceFaultError:
    """Pictures of another depth than OpenCV's videos have."""
    return DeviceFaultError(
        name,
        f"its pictures are of {found}, not of 8 bits",
        not_done="the picture was not used, and no more are taken",
        to_do="set the camera to 8 bits, or use it as genicam_camera or http_camera, which take more",
    )


def in_colours(name: str) -> DeviceFaultError:
    """Three unequal channels, and nobody has said which."""
    return DeviceFaultError(
        name,
        "its pictures are in colours: red, green and blue differ",
        not_done="the picture was not used, and no more are taken",
        to_do="write channel: green (or red, blue, gray) in the rig file, or set the camera to gray",
    )


def frozen(name: str, pictures: int) -> DeviceFaultError:
    """The same picture again and again."""
    return DeviceFaultError(
        name,
        f"the picture stands still: {pictures} in a row are the same bit for bit, which noise does not allow",
        not_done="the reading was not finished, and no more pictures are taken",
        to_do="switch the camera off and on; if it has no noise, write most_identical_frames: 0 in the rig file",
    )


def other_rate(name: str, found_s: float, wanted_s: float, lost: int) -> DeviceFaultError:
    """Readings would last another time than they say."""
    others = f"; {lost} more seem to be missing or were damaged" if lost else ""
    return DeviceFaultError(
        name,
        f"its pictures come every {found_s:.4g} s, where the rig file has sample_s: {wanted_s:g}{others}",
        not_done="no reading was begun",
        to_do=f"write sample_s: {found_s:.4g} if the camera is meant to be as fast as that, or set its rate"
        + (f"; if pictures are lost, {_FASTER}" if lost else ""),
    )

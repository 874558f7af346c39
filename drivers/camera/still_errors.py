"""What a person is told when a camera's still picture is not what was asked for."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.camera.http_exchange import HttpResponse
from goniometer.errors import DeviceError, DeviceFaultError, LimitError, ReplyError, ReplyTimeoutError

_THROWN_AWAY = "the picture was thrown away"
_BAD_REQUEST = 400


def overdue(device: str, port: str, exposure_s: float, limit_s: float, attempts: int) -> ReplyTimeoutError:
    """Describe a picture that does not come, or not whole."""
    return ReplyTimeoutError(
        device,
        f"no whole picture came on port {port} within {limit_s:.3g} s of a question for {exposure_s:g} s of exposure, "
        f"{attempts} times",
        not_done="no picture was taken",
        to_do="check that the camera is on, that no other program uses it, and readout_s in the rig file",
    )


def refused(device: str, path: str, response: HttpResponse) -> DeviceError:
    """Describe an answer that is an error, in the camera's own words."""
    kind = LimitError if response.status == _BAD_REQUEST else DeviceFaultError
    return kind(
        device,
        f"the camera answers {path!r} with error {response.status}: {response.text or 'without a word'}",
        not_done="no picture was taken",
        to_do="compare still, bits and gain_db in the rig file and exposure_s in the recipe with what the camera "
        "takes; end other programs that use it",
    )


def contradicted(device: str, contradictions: Sequence[str]) -> DeviceFaultError:
    """Describe a camera that is not the one in the rig file."""
    return DeviceFaultError(
        device,
        f"it is another camera than the rig file describes: {'; '.join(contradictions)}",
        not_done="no picture was taken",
        to_do="correct the rig file, or look which camera is at this address",
    )


def not_an_exposure(device: str, exposure_s: float, limits_s: tuple[float, float]) -> LimitError:
    """Describe an exposure that the camera does not have."""
    return LimitError(
        device,
        f"an exposure of {exposure_s:g} s is not between {limits_s[0]:g} and {limits_s[1]:g} s, the camera's limits",
        not_done="the reading was not begun and nothing was sent",
        to_do="change exposure_s in the recipe",
    )


def not_as_asked(device: str, what: str, applied: float, asked: float) -> DeviceFaultError:
    """Describe a picture that was taken with another exposure or gain."""
    return DeviceFaultError(
        device,
        f"the picture was taken with {what} {applied:g} and not {asked:g}",
        not_done=_THROWN_AWAY,
        to_do="end other programs that use the camera, switch its automatic exposure and gain off, and ask for what it "
        "really has",
    )


def says_less(device: str, left_out: Sequence[str]) -> ReplyError:
    """Describe a picture without headers that others before it have."""
    *first, last = left_out
    names = f"{', '.join(first)} and {last}" if first else last
    return ReplyError(
        device,
        f"the camera has sent a picture without {names}, which others have",
        not_done=_THROWN_AWAY,
        to_do="look at the network between, and at the camera's firmware; a camera that never sends such a header is "
        "taken without it",
    )


def stale(device: str, number: int, last: int) -> DeviceFaultError:
    """Describe a frame that is not new."""
    what = f"frame {number} once more" if number == last else f"frame {number} behind frame {last}"
    return DeviceFaultError(
        device,
        f"the camera has sent {what}: it shows an earlier moment",
        not_done=_THROWN_AWAY,
        to_do="switch the camera off and on, and run the recipe again; a proxy between must not store pictures",
    )


def too_soon(device: str, since_s: float, exposure_s: float) -> DeviceFaultError:
    """Describe a picture that was there before its exposure can have ended."""
    return DeviceFaultError(
        device,
        f"the whole picture had come {since_s:.3g} s after it was asked for, before {exposure_s:g} s of exposure can "
        "have passed: it shows an earlier moment",
        not_done=_THROWN_AWAY,
        to_do="let the camera begin an exposure with each question (triggered by software, not running freely); "
        "nothing between may store pictures",
    )


def shifted(device: str, off_by_s: float) -> DeviceFaultError:
    """Describe a frame that was exposed at another time than it was asked for."""
    when = (
        f"began {-off_by_s:.3g} s before it was asked for" if off_by_s < 0 else f"ended {off_by_s:.3g} s after it came"
    )
    return DeviceFaultError(
        device,
        f"by the camera's clock, which was followed since it was connected, the exposure {when}: it shows another "
        "moment of the bench, or the clock was set",
        not_done=_THROWN_AWAY,
        to_do="switch off what stores pictures in the camera or between, and what sets its clock; run the recipe again",
    )


def silent(device: str, port: str, path: str, limit_s: float) -> ReplyTimeoutError:
    """Describe a camera that does not say what it is."""
    return ReplyTimeoutError(
        device,
        f"no answer to {path!r} on port {port} within {limit_s:g} s",
        not_done="the camera was not set up",
        to_do="check that the camera is on, and that the address in the rig file is the camera's",
    )

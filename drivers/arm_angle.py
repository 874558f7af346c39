"""How near two arms come to each other when one of them also turns about the sample's normal."""

from __future__ import annotations

import math

Span = tuple[float, float]
"""Lowest and highest angle, in radians."""


def nearest_deg(source_deg: Span, detector_deg: Span, azimuth_deg: Span) -> float:
    """The least angle between source arm and detector arm anywhere in the spans of their axes, in degrees.

    With the source at s from the normal, the detector at e and its plane turned by a, the cosine of the angle between
    the arms is cos s cos e - cos a sin s sin e. For a given cos a it is largest at an edge of the spans, or where both
    arms stand along the normal; in cos a it is linear.

    Parameters
    ----------
    source_deg, detector_deg, azimuth_deg : tuple of float
        Lowest and highest angle of source arm, detector arm and detector azimuth, in degrees.
    """
    source, detector, azimuth = (
        (math.radians(low), math.radians(high)) for low, high in (source_deg, detector_deg, azimuth_deg)
    )
    cosines = _largest_cosine(azimuth), -_largest_cosine(azimuth, -math.pi)
    largest = max(_largest(source, detector, cosine) for cosine in cosines)
    return math.degrees(math.acos(max(-1.0, min(largest, 1.0))))


def _largest(source: Span, detector: Span, cos_azimuth: float) -> float:
    if any(_largest_cosine(source, turn) == _largest_cosine(detector, turn) == 1.0 for turn in (0.0, -math.pi)):
        return 1.0  # both along the normal, or both along its opposite
    edges = [(end, detector) for end in source] + [(end, source) for end in detector]
    return max(_largest_on_edge(fixed, moving, cos_azimuth) for fixed, moving in edges)


def _largest_on_edge(fixed: float, moving: Span, cos_azimuth: float) -> float:
    """Of cos(fixed) cos(x) - cos_azimuth sin(fixed) sin(x), for x within the other arm's span."""
    along, across = math.cos(fixed), -cos_azimuth * math.sin(fixed)
    return math.hypot(along, across) * _largest_cosine(moving, -math.atan2(across, along))


def _largest_cosine(span: Span, turn: float = 0.0) -> float:
    """The largest cosine of an angle within a span that is turned."""
    low, high = span[0] + turn, span[1] + turn
    if high >= math.tau * math.ceil(low / math.tau):
        return 1.0
    return max(math.cos(low), math.cos(high))

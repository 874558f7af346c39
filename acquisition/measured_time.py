"""When something was measured, as files say it: ISO 8601 with the time zone."""

from __future__ import annotations

from datetime import datetime


def time_fault(text: str) -> str:
    """Why a text is no such time; empty when it is one."""
    try:
        if datetime.fromisoformat(text).tzinfo is not None:
            return ""
    except ValueError:
        return f"got '{text}'; allowed: a time such as '2026-01-31T12:00:00+00:00'"
    return f"got '{text}'; allowed: a time with its zone, '2026-01-31T12:00:00+00:00'"

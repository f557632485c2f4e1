"""The kinds of frames."""

from __future__ import annotations

from enum import StrEnum


class Kind(StrEnum):
    """What a frame is, as a capture's report names it."""

    BRIGHT = "bright"
    """The flash lit it wholly."""
    DARK = "dark"
    """The flash lit none of it."""
    PARTIAL = "partial"
    """The flash lit some rows, or all for a part of their exposure."""
    REJECTED = "rejected"
    """It should be bright or dark and is of no use; a reason is given."""

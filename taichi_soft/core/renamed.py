"""Warnings for old public names that still work in this version."""

import warnings


def warn_renamed(old: str, new: str) -> None:
    """Warn that a public name has been renamed. The warning points to the code that used the old name."""
    warnings.warn(
        f"{old} is deprecated and will be removed in the next version: use {new}",
        DeprecationWarning,
        stacklevel=3,
    )

"""Errors and warnings. Every message contains the value that was received, and says what to do."""


class TaichiSoftError(Exception):
    """Base class of all errors of this package. The text is always one line."""

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


class MeshError(TaichiSoftError, ValueError):
    """A mesh or a mesh file cannot be simulated."""


class MaterialError(TaichiSoftError, ValueError):
    """A material constant is outside its physical range."""


class OptionError(TaichiSoftError, ValueError):
    """An argument has an invalid value."""


class MissingExtraError(OptionError, ImportError):
    """A feature needs packages of an extra that are not installed."""


class StateError(TaichiSoftError, RuntimeError):
    """The call is not allowed in the current state (for example `step` before `build`)."""


class SnapshotError(TaichiSoftError, ValueError):
    """A snapshot or a recording is damaged, or belongs to another world."""


class DeviceError(TaichiSoftError, RuntimeError):
    """The requested device is not available."""


class VideoError(TaichiSoftError, OSError):
    """A video or image could not be written."""


class BakeError(TaichiSoftError, OSError):
    """A bake could not be written."""


class SlowStepWarning(UserWarning):
    """A step takes more than 500 substeps. The text names the body and the cause, and says what to do."""


class TooSoftWarning(UserWarning):
    """A body's pressure on its base exceeds a fifth of its Young's modulus, so that the body collapses."""


class UnstableStepWarning(UserWarning):
    """The substep is longer than the estimated largest stable substep."""


class FrozenBodyWarning(UserWarning):
    """A body became non-finite and was frozen in its last finite state."""


class DroppedEventsWarning(UserWarning):
    """Events were dropped, because too many events were waiting for `drain_events`."""


class SolverWarning(UserWarning):
    """An implicit solve did not reach its tolerance, or tetrahedra stay inverted."""


class SkippedCellsWarning(UserWarning):
    """A mesh file has cells that are not tetrahedra. The body does not contain them."""

"""What can go wrong, by kind. Every message names the value received and the way out."""


class TaichiSoftError(Exception):
    """Base of every error this package raises on purpose. Its text is one line, whatever was received."""

    def __str__(self) -> str:
        return " ".join(super().__str__().split())


class MeshError(TaichiSoftError, ValueError):
    """A mesh, or the file it comes from, cannot be simulated as it is."""


class MaterialError(TaichiSoftError, ValueError):
    """A material constant lies outside its physical range."""


class OptionError(TaichiSoftError, ValueError):
    """An argument has a value that this call does not take."""


class MissingExtraError(OptionError, ImportError):
    """What was asked for needs packages of an extra that are not installed."""


class StateError(TaichiSoftError, RuntimeError):
    """The call is right but comes at the wrong time (for example `step` before `build`)."""


class SnapshotError(TaichiSoftError, ValueError):
    """A snapshot or a recording is damaged, or belongs to another world."""


class DeviceError(TaichiSoftError, RuntimeError):
    """The device asked for is not there."""


class VideoError(TaichiSoftError, OSError):
    """A video or picture could not be written as asked."""


class BakeError(TaichiSoftError, OSError):
    """A bake could not be written as asked."""


class SlowStepWarning(UserWarning):
    """A step takes more than 500 substeps. It names the body, what asks for them, and the way out."""


class TooSoftWarning(UserWarning):
    """A body's weight on its foot exceeds a fifth of its Young's modulus: it cannot bear it."""


class UnstableStepWarning(UserWarning):
    """The substep is larger than the estimate of what stays stable."""


class FrozenBodyWarning(UserWarning):
    """A body went non-finite, was put back to its last finite state and frozen."""


class DroppedEventsWarning(UserWarning):
    """More events happened than there is room for, because nobody drained them."""


class SolverWarning(UserWarning):
    """An implicit solve stopped before it was as exact as asked for, or tetrahedra stay inside out."""


class SkippedCellsWarning(UserWarning):
    """A mesh file holds cells that are not tetrahedra, and the body is without them."""

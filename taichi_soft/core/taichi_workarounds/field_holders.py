"""Pass objects with fields to kernels, without a Python call for each attribute that is read.

`ti.data_oriented` replaces `__getattribute__` of a class to bind kernels that are its methods. Every
attribute of an object then costs a Python call, and two if a base class has the decorator too.

Needless once `ti.data_oriented` leaves classes without kernels alone; main branch does not. We know of no
thread about it.
"""

from typing import TypeVar

Class = TypeVar("Class", bound=type)


def holds_fields(cls: Class) -> Class:
    """Let a kernel take an object with all its fields as one argument. The class must have no kernels."""
    cls._data_oriented = True  # type: ignore[attr-defined]
    return cls

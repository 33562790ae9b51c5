"""Objects with fields as arguments of kernels, without a call in Python of each attribute that is read.

`ti.data_oriented` replaces `__getattribute__` of a class to bind kernels that are its methods. Every
attribute of an object then costs a call in Python, and two where a base class has the decorator too.

Needless once `ti.data_oriented` leaves classes without kernels alone; main branch does not. We know of no
thread about it.
"""

from typing import TypeVar

Class = TypeVar("Class", bound=type)


def holds_fields(cls: Class) -> Class:
    """Let a kernel take an object with all its fields as one argument. The class has no kernels of its
    own."""
    cls._data_oriented = True  # type: ignore[attr-defined]
    return cls

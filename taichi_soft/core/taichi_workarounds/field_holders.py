"""Pass objects with fields to kernels without a Python call for each attribute access.

`ti.data_oriented` replaces `__getattribute__` of a class, so that methods of the class can be kernels. Every
access to an attribute then costs a Python call, or two calls if a base class has the decorator too.

This file is unnecessary once `ti.data_oriented` does not change classes without kernels. The main branch
still changes these classes. We know of no issue about this.
"""

from typing import TypeVar

Class = TypeVar("Class", bound=type)


def holds_fields(cls: Class) -> Class:
    """Decorate a class, so that kernels can receive an object with all its fields as one argument.

    No method of the class can be a kernel.
    """
    cls._data_oriented = True  # type: ignore[attr-defined]
    return cls

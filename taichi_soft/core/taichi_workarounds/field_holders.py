"""Pass objects with fields to kernels without a Python call for each attribute access.

`ti.data_oriented` replaces `__getattribute__` of a class to bind kernels that are its methods. Every
attribute of an object then costs a Python call, and two if a base class has the decorator too.

This file is unnecessary once `ti.data_oriented` does not change classes without kernels. The main branch
still does. We know of no thread about it.
"""

from typing import TypeVar

Class = TypeVar("Class", bound=type)


def holds_fields(cls: Class) -> Class:
    """Allow kernels to receive an object with all its fields as one argument. The class must have no
    kernels.
    """
    cls._data_oriented = True  # type: ignore[attr-defined]
    return cls

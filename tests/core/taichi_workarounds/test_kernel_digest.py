"""A digest distinguishes all kernels whose code differs."""

from dataclasses import dataclass

import numpy as np
import pytest

from taichi_soft.core.runtime import holds_fields, init, ti
from taichi_soft.core.taichi_workarounds import kernel_digest
from taichi_soft.core.taichi_workarounds.kernel_digest import UnknownPartError, digest_of
from taichi_soft.core.types import Integrator
from taichi_soft.elements.laws import LAWS, element_model


@holds_fields
class Fields:
    def __init__(self, size, dtype=ti.f32, option="a"):
        self.x = ti.field(dtype, size)
        self.option = option


@dataclass(frozen=True)
class Choice:
    integrator: Integrator
    model: object


def kernel_like():
    """Stands for the function of a kernel."""


def digest(*values):
    return digest_of(kernel_like, "", [(value, True) for value in values])


def test_a_digest_tells_apart_all_that_code_is_made_of():
    init("cpu")
    models = [element_model(name, strain) for name in ("virial", "face") for strain in ("linear", "exact")]
    models += [element_model("virial", flips=each) for each in LAWS["virial"].flips[1:]]
    found = [digest(Choice(integrator, model)) for integrator in Integrator for model in models]
    found += [digest(Fields(4)), digest(Fields(4)), digest(Fields(5)), digest(Fields(4, ti.f64))]
    fields = Fields(4)
    found.append(digest(fields))
    fields.option = "b"
    found += [digest(fields), digest(1), digest(1.0), digest(True), digest("1"), digest(None), digest((1, 2))]
    found += [digest(np.arange(3)), digest(np.arange(4)), digest(1, 2), digest({1: 2}), digest([1, 2])]
    assert len(set(found)) == len(found)
    assert digest(fields) == digest(fields)


def test_other_options_of_taichi_give_another_digest():
    """They are in the key under which Taichi keeps a kernel, and not in its name."""
    assert digest_of(kernel_like, "fast_math", []) != digest_of(kernel_like, "", [])


def test_other_sources_give_another_digest(monkeypatch):
    before = digest(1)
    monkeypatch.setattr(kernel_digest, "digest_of_sources", lambda: "others")
    assert digest(1) != before


def test_what_nothing_is_known_of_gives_none():
    for value in (object(), lambda: 1, open):
        with pytest.raises(UnknownPartError):
            digest(value)

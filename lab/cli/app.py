"""Commands of `python -m lab`."""

from __future__ import annotations

from lab.cli.contact import contact
from lab.cli.drop_test import drop_test
from lab.cli.peers import peers
from lab.cli.report import report
from taichi_soft.cli.running import make_app

app = make_app(
    "Experiments on taichi-soft: the thesis's claims, what breaks, and other engines.",
    *(report, drop_test, contact, peers),
)

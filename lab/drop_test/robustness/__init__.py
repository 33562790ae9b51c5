"""Drop or strongly deform single bodies with many meshes, materials and step lengths."""

from lab.drop_test.robustness.cell_run import run_cell
from lab.drop_test.robustness.cells import GROUPS, choose_cells, law_variants
from lab.drop_test.robustness.verdict import Verdict

__all__ = ["GROUPS", "Verdict", "choose_cells", "law_variants", "run_cell"]

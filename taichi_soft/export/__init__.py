"""Export a built world as a folder that the native library (`engine_adapter/native`) can run."""

from taichi_soft.export.engine_axes import AXES
from taichi_soft.export.exporting import ExportReport, export_world
from taichi_soft.export.machine_code import PLATFORMS

__all__ = ["AXES", "PLATFORMS", "ExportReport", "export_world"]

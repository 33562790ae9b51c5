"""Sections prepared for the page: images as files, tables as text, file names and links."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lab.experiments import (
    Experiment,
    MissingPointError,
    Picture,
    Plot,
    Result,
    Results,
    Section,
    Table,
)
from lab.report.plots import png_of
from lab.report.spreadsheets import csv_of_points, csv_of_table
from lab.report.wording import numeric_columns, readable
from taichi_soft.core.errors import OptionError
from taichi_soft.render.opencv import cv2

LONG = 12
"""Largest number of rows of a table that is shown in full; longer tables are folded."""

WIDE = 640
"""Images wider than this are placed in a separate row [pixels]."""


@dataclass(frozen=True)
class Image:
    """A plot or image of bodies.

    Args:
        path: path of the file, relative to the page.
        png: content of the file; empty if a plot needs a point that failed.
        error: reason for an empty `png`.
    """

    path: str
    caption: str
    png: bytes
    width: int
    height: int
    error: str = ""

    @property
    def is_wide(self) -> bool:
        """True if the image is placed in a separate row, so that its text stays readable."""
        return self.width > WIDE

    @property
    def uri(self) -> str:
        """Data URI of the image."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


@dataclass(frozen=True)
class Sheet:
    """A formatted table. `right` is True for each column of numbers. Columns of numbers are aligned right."""

    path: str
    title: str
    columns: tuple[str, ...]
    right: tuple[bool, ...]
    rows: tuple[tuple[str, ...], ...]
    csv: str

    @property
    def is_long(self) -> bool:
        """True if the table is folded."""
        return len(self.rows) > LONG

    @property
    def shown(self) -> tuple[tuple[str, ...], ...]:
        """First rows of the table, for a format that cannot fold."""
        return self.rows[:LONG]

    @property
    def uri(self) -> str:
        """Data URI of the CSV file."""
        return "data:text/csv;charset=utf-8;base64," + base64.b64encode(self.csv.encode()).decode("ascii")


@dataclass(frozen=True)
class Exhibit:
    """An experiment and the prepared contents of its section."""

    experiment: Experiment
    section: Section
    plots: tuple[Image, ...]
    pictures: tuple[Image, ...]
    sheets: tuple[Sheet, ...]
    points: int
    failed: tuple[Result, ...]
    seconds: float
    points_path: str
    points_csv: str

    @property
    def anchor(self) -> str:
        """Anchor of the section's heading."""
        return "experiment-" + file_name(self.experiment.name)


def exhibit_of(experiment: Experiment, results: Results, section: Section) -> Exhibit:
    """Draw the plots of a section and format its tables.

    Raises: OptionError for duplicate names or rows of a wrong length.
    """
    name = file_name(experiment.name)
    for kind in (section.tables, section.plots, section.pictures):
        require_distinct((each.name for each in kind), experiment.name)
    return Exhibit(
        experiment,
        section,
        tuple(_drawn(plot, f"plots/{name}-{file_name(plot.name)}.png") for plot in section.plots),
        tuple(_encoded(each, f"pictures/{name}-{file_name(each.name)}.png") for each in section.pictures),
        tuple(sheet_of(table, f"tables/{name}-{file_name(table.name)}.csv") for table in section.tables),
        len(results.rows),
        tuple(results.failed),
        sum(row.seconds for row in results.rows),
        f"points/{name}.csv",
        csv_of_points(results),
    )


def file_name(name: str) -> str:
    """Replace the characters of a name that files or links do not allow."""
    return re.sub(r"[^A-Za-z0-9_.]+", "-", name).strip("-.") or "unnamed"


def require_distinct(names: Iterable[str], whose: str) -> None:
    """Raise an OptionError if two names would have the same file name."""
    seen: set[str] = set()
    for name in names:
        if file_name(name).lower() in seen:
            raise OptionError(f"{whose} has two files of the name {file_name(name)!r}")
        seen.add(file_name(name).lower())


def _drawn(plot: Plot, path: str) -> Image:
    try:
        png, (width, height) = png_of(plot)
    except MissingPointError as error:
        return Image(path, plot.caption, b"", 0, 0, str(error))
    return Image(path, plot.caption, png, width, height)


def _encoded(picture: Picture, path: str) -> Image:
    image = picture.image
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise OptionError(f"picture {picture.name!r} must be uint8 (height, width, 3), got {image.shape}")
    done, png = cv2.imencode(
        ".png", np.ascontiguousarray(image[:, :, ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 9]
    )
    if not done:
        raise OptionError(f"picture {picture.name!r} of shape {image.shape} cannot be written as PNG")
    return Image(path, picture.caption, png.tobytes(), image.shape[1], image.shape[0])


def sheet_of(table: Table, path: str) -> Sheet:
    """Format a table as text. Raises: OptionError for rows of a wrong length."""
    for row in table.rows:
        if len(row) != len(table.columns):
            raise OptionError(
                f"table {table.name!r} has {len(table.columns)} columns and a row of {len(row)}"
            )
    return Sheet(
        path,
        table.title,
        table.columns,
        numeric_columns(table.rows, len(table.columns)),
        tuple(tuple(readable(value) for value in row) for row in table.rows),
        csv_of_table(table),
    )

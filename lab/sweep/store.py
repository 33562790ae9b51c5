"""Store the results of points in a file, so that an interrupted sweep can resume."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lab.sweep.task import Outcome
from taichi_soft.core.errors import TaichiSoftError

FORMAT = "taichi-soft sweep 1"


class SweepError(TaichiSoftError, RuntimeError):
    """A file of results cannot be used."""


class Store:
    """Outcomes of points in a JSON-lines file: a header with the origin, then one line per point.

    An incomplete last line is dropped, and its point is computed again. A file of another origin is renamed.

    Args:
        origin: sources, versions and device of the results, from `sweep.origin`.
    Attributes:
        set_aside: new path of a file with results of another origin, or None.
    Raises: SweepError if the file has another format or cannot be written. A file of another format stays
        unchanged.
    """

    def __init__(self, path: Path, origin: Mapping[str, str]) -> None:
        self.path = path
        self.set_aside: Path | None = None
        self._outcomes: dict[str, Outcome] = {}
        header = {"format": FORMAT, "origin": dict(origin)}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            length = self._read(header) if path.exists() else 0
            self._file = path.open("ab")
            self._file.truncate(length)
            if not length:
                self._append(header)
        except OSError as error:
            raise self._refusal(error) from error

    def get(self, point: Mapping[str, Any]) -> Outcome | None:
        """Return the outcome of a point; None if it is not stored."""
        return self._outcomes.get(_key(point))

    def keep(self, point: Mapping[str, Any], outcome: Outcome) -> None:
        """Store the outcome of a point. A later outcome replaces an earlier one. Raises: SweepError."""
        self._outcomes[_key(point)] = outcome
        try:
            self._append({"point": point, **vars(outcome)})
        except OSError as error:
            raise self._refusal(error) from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _append(self, row: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(row).encode() + b"\n")
        self._file.flush()

    def _read(self, header: Mapping[str, Any]) -> int:
        """Read the existing results. Returns: length of the part of the file to keep [bytes]."""
        data = self.path.read_bytes()
        length = data.rfind(b"\n") + 1
        lines = data[:length].splitlines()
        if not lines:
            start = json.dumps({"format": FORMAT}).encode()[:-1]
            if data[: len(start)] != start[: len(data)]:
                raise self._foreign(1)
            return 0
        first = self._parse(lines[0], 1)
        if set(first) != set(header) or not isinstance(first["origin"], dict):
            raise self._foreign(1)
        if first["format"] != FORMAT:
            raise SweepError(
                f"{str(self.path)!r} has the format {first['format']!r}, wanted {FORMAT!r}: move it away, or "
                "choose another folder"
            )
        if first != header:
            self._rename(str(first["origin"].get("sources", "old"))[:8])
            return 0
        for number, line in enumerate(lines[1:], 2):
            row = self._parse(line, number)
            try:
                key = _key(row.pop("point"))
                self._outcomes[key] = _checked(Outcome(**row))
            except (KeyError, TypeError):
                raise self._foreign(number) from None
        return length

    def _parse(self, line: bytes, number: int) -> dict[str, Any]:
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            raise self._foreign(number) from None
        if not isinstance(row, dict):
            raise self._foreign(number)
        return row

    def _rename(self, mark: str) -> None:
        names = (self.path.with_suffix(f".{mark}{'-' * bool(n)}{n or ''}.jsonl") for n in range(1000))
        self.set_aside = next(name for name in names if not name.exists())
        self.path.rename(self.set_aside)

    def _foreign(self, line: int) -> SweepError:
        return SweepError(
            f"line {line} of {str(self.path)!r} is no result of this program: move the file away, or choose "
            "another folder"
        )

    def _refusal(self, error: OSError) -> SweepError:
        return SweepError(
            f"cannot keep results in {str(self.path)!r} ({error.strerror or error}): choose another folder"
        )


def _key(point: Mapping[str, Any]) -> str:
    if not isinstance(point, Mapping):
        raise TypeError
    return json.dumps(point, sort_keys=True)


def _checked(outcome: Outcome) -> Outcome:
    """Return `outcome` after checking the types of its values. Raises: TypeError."""
    if not (
        isinstance(outcome.numbers, dict | None)
        and isinstance(outcome.error, str)
        and isinstance(outcome.seconds, int | float)
    ):
        raise TypeError
    return outcome

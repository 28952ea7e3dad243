"""A table as this package hands it out: to look at, to take apart, and to give to any library of data frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta, timezone
from html import escape
from typing import Any, overload

from athermal import _frames
from athermal._athermal import Table
from athermal._errors import NoColumnError, NoRowError

_EPOCH = datetime(1970, 1, 1)
_SHOWN = 5


class Frame:
    """A table of Arrow: for pandas, polars, pyarrow, DuckDB, or whoever else takes `__arrow_c_stream__`.

    `frame["Z1_nm"]` is a column as a list, `frame[["time_s", "Z1_nm"]]` a frame of some columns, `frame[7]` a row as a dict, `frame[:100]`
    a frame of some rows. Its length is its rows, and it gives one after the other as a dict.
    """

    def __init__(self, table: Table) -> None:
        self._table = table

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return self._table.column_names

    def __len__(self) -> int:
        return len(self._table)

    @overload
    def __getitem__(self, key: str) -> list[Any]: ...
    @overload
    def __getitem__(self, key: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, key: slice | list[str] | tuple[str, ...]) -> Frame: ...
    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            self._check([key])
            return self._table.column(key)
        if isinstance(key, slice):
            places = range(*key.indices(len(self)))
            if places.step == 1:
                return Frame(self._table.rows(places.start, max(places.start, places.stop)))
            return Frame(Table.joined([self._table.rows(at, at + 1) for at in places] or [self._table.rows(0, 0)]))
        if isinstance(key, (list, tuple)) and all(isinstance(of, str) for of in key):
            self._check(key)
            return Frame(self._table.only(list(key)))
        if not hasattr(key, "__index__"):
            raise TypeError(f"a frame is asked for a column, a list of columns, a row or a slice of rows, not for {key!r}")
        at = key.__index__()
        if not -len(self) <= at < len(self):
            raise NoRowError(f"there is no row {at}: the frame has {len(self):,}")
        at %= len(self)
        return {name: of[0] for name, of in self._table.rows(at, at + 1).to_dict().items()}

    def _check(self, names: Sequence[str]) -> None:
        for name in names:
            if name not in self.columns:
                raise NoColumnError(f"there is no column `{name}`; found {', '.join(f'`{of}`' for of in self.columns)}")

    def __iter__(self) -> Iterator[dict[str, Any]]:
        names = self.columns
        for begin in range(0, len(self), 1024):
            some = self._table.rows(begin, begin + 1024).to_dict()
            yield from (dict(zip(names, row)) for row in zip(*some.values()))

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Frame) and self.columns == other.columns and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return _frame_of, (self._table.to_bytes(),)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)

    def to_dict(self) -> dict[str, list[Any]]:
        """The columns as lists; instants as ns since 1970, `None` where there is nothing."""
        return self._table.to_dict()

    def to_pandas(self) -> Any:
        """The same as a frame of pandas, which must be installed."""
        return _frames.to_pandas(self._table)

    def to_polars(self) -> Any:
        """The same as a frame of polars, which must be installed."""
        return _frames.to_polars(self._table)

    def to_pyarrow(self) -> Any:
        """The same as a table of pyarrow, which must be installed."""
        import pyarrow

        return pyarrow.table(self._table)

    def _shown(self) -> tuple[list[list[str]], int]:
        """The first rows and the last in words, and how many stand between them."""
        left_out = max(0, len(self) - 2 * _SHOWN)
        first = self._table.rows(0, _SHOWN if left_out else len(self))
        last = self._table.rows(len(self) - _SHOWN, len(self)) if left_out else first.rows(0, 0)
        columns = []
        for name in self.columns:
            clock = self._table.clock(name)
            columns.append([_cell(of, clock) for of in first.column(name) + last.column(name)])
        return [list(row) for row in zip(*columns)], left_out

    def __repr__(self) -> str:
        names, (rows, left_out) = self.columns, self._shown()
        # As many columns as a line of a terminal has room for.
        widths = [max(map(len, [name, *(row[nth] for row in rows)])) for nth, name in enumerate(names)]
        fits = next((nth for nth in range(len(widths)) if sum(widths[: nth + 1]) + 2 * nth > 110), len(widths))
        fits = max(fits, 1)
        lines = ["  ".join(of.rjust(width) for of, width in zip(row[:fits], widths)) for row in [names, *rows]]
        if left_out:
            lines.insert(1 + _SHOWN, "…")
        more = f", of which {len(names) - fits} are not shown" if fits < len(names) else ""
        return "\n".join([f"<athermal.Frame of {len(self):,} rows and {len(names)} columns{more}>", *lines])

    def _repr_html_(self) -> str:
        rows, left_out = self._shown()
        between = [["…"] * len(self.columns)] if left_out else []
        all_rows = rows[:_SHOWN] + between + rows[_SHOWN:] if left_out else rows
        head = "".join(f"<th>{escape(of)}</th>" for of in self.columns)
        body = "".join("<tr>" + "".join(f"<td>{escape(of)}</td>" for of in row) + "</tr>" for row in all_rows)
        return (
            f"<table class='athermal'><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
            f"<p>{len(self):,} rows, {len(self.columns)} columns</p>"
        )


def _cell(value: Any, clock: tuple[str, str | None] | None) -> str:
    if value is None:
        return "–"
    if clock is not None:
        at = _EPOCH + timedelta(microseconds=value // 1000)
        zone = clock[1]
        if zone is None:
            return at.isoformat(" ")
        return at.replace(tzinfo=timezone.utc).astimezone(_frames.zone_of(zone)).isoformat(" ")
    return f"{value:.{6 if abs(value) < 1e5 else 12}g}" if isinstance(value, float) else str(value)


def _frame_of(table: bytes) -> Frame:
    return Frame(Table.of_bytes(table))

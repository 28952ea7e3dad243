"""Data frames of any library as tables of Arrow, and back. No library is imported that is not there already."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone, tzinfo
from typing import Any
from zoneinfo import ZoneInfo

from athermal._athermal import Table
from athermal._errors import RequestError
from athermal._progress import Progress, listener

_EPOCH = datetime(1970, 1, 1)


class Call:
    """What a function of the library is asked for: options, and the tables that names of data among them stand for."""

    def __init__(self, options: Mapping[str, Any], progress: Progress = None) -> None:
        self._options = {name.rstrip("_"): of for name, of in options.items() if of is not None}
        self.tables: list[tuple[str, Table]] = []
        self.progress = listener(progress)

    @property
    def options(self) -> str:
        """The options as JSON; what has a form of its own goes by its text."""
        return json.dumps(self._options, default=str)

    def set(self, name: str, value: Any) -> None:
        """Gives an option a value."""
        self._options[name] = value


def module_of(of: object) -> str:
    return type(of).__module__.partition(".")[0]


def add_data(
    call: Call,
    given: Any,
    *,
    name: str = "frame",
    option: str = "data",
    columns: Iterable[str] | None = None,
    renamed: Mapping[str, str] | None = None,
) -> None:
    """Adds a frame, the path of a file, or a list of them, of which each is a segment of its own, to what a call reads.

    Only the named columns are looked at, all where none are named. `renamed` gives columns of the frame other names.
    """
    names_of_data: list[str] = []
    several = isinstance(given, (list, tuple))
    if several and not given:
        raise TypeError("the list of frames is empty")
    for nth, one in enumerate(given if several else [given]):
        if isinstance(one, (str, os.PathLike)):
            names_of_data.append(os.fspath(one))
            continue
        its_name = f"{name}[{nth}]" if several else name
        names_of_data.append(its_name)
        wanted = None if columns is None else dict.fromkeys(columns)
        names = dict(renamed or {})
        for given_name, graph_name in names.items():
            if wanted is not None:
                wanted.pop(graph_name, None)
                wanted[given_name] = None
        its_table = table(one, wanted)
        there = its_table.column_names
        for given_name in names:
            if given_name not in there:
                raise RequestError(f"{its_name}: there is no column `{given_name}`; found {', '.join(f'`{of}`' for of in there)}")
        if names:
            its_table = its_table.renamed(names)
        call.tables.append((its_name, its_table))
    call.set(option, names_of_data)
    if several and len(given) > 1:
        call.set("segments", True)


def table(frame: Any, wanted: Iterable[str] | None = None) -> Table:
    """The table of a frame, with the wanted columns at least, where it has them."""
    if isinstance(frame, Table):
        return frame
    library = module_of(frame)
    if library in ("pandas", "polars") and not hasattr(type(frame), "columns"):
        library = "one column"
    if library == "polars":
        if hasattr(frame, "collect"):
            there = frame.collect_schema().names()
            frame = frame.select(_there(there, wanted)).collect()
        else:
            frame = frame.select(_there(frame.columns, wanted))
        # A column in which nothing ever was has a type of its own, which polars does not hand over as Arrow wants it.
        nothing = [name for name, of in frame.schema.items() if str(of) == "Null"]
        frame = frame.with_columns(sys.modules["polars"].lit(None, sys.modules["polars"].Float64).alias(of) for of in nothing)
    elif library in ("duckdb", "_duckdb"):
        # Columns are named as they are, whatever signs they have.
        there = _there(frame.columns, wanted)
        if there and len(there) < len(frame.columns):
            frame = frame.project(", ".join('"' + of.replace('"', '""') + '"' for of in there))
    elif library == "pandas":
        return _of_pandas(frame, _there(list(frame.columns), wanted))
    elif isinstance(frame, Mapping):
        return _of_columns((of, frame[of]) for of in _there(list(frame), wanted))
    elif library == "numpy" and getattr(frame.dtype, "names", None):
        return _of_columns((of, frame[of]) for of in _there(frame.dtype.names, wanted))
    if library != "one column" and (hasattr(frame, "__arrow_c_stream__") or hasattr(frame, "__arrow_c_array__")):
        return Table.from_arrow(frame)
    kind = type(frame)
    raise TypeError(
        f"{kind.__module__}.{kind.__qualname__} is no data frame: give one of pandas, polars, pyarrow or DuckDB, anything with "
        "`__arrow_c_stream__`, a dict of columns, the path of a file, or a list of these"
    )


def _there(columns: Sequence[Any], wanted: Iterable[str] | None) -> list[Any]:
    if wanted is None:
        return list(columns)
    wanted = set(wanted)
    found = [of for of in columns if of in wanted]
    # A frame without any of them is still one with rows, and its names are told apart in messages.
    return found if len(found) == len(wanted) else list(columns)


def _of_pandas(frame: Any, columns: list[Any]) -> Table:
    twice = [of for nth, of in enumerate(columns) if of in columns[:nth]]
    if twice:
        raise RequestError(f"two columns have the name `{twice[0]}`: give one of them another")
    try:
        import pyarrow
    except ImportError:
        return _of_columns((str(of), frame[of]) for of in columns)

    def array(of: Any) -> Any:
        series = frame[of]
        if module_of(series.dtype) == "numpy" and series.dtype.kind in "fiu":
            # Without a look at what is NaN, which is absent here as null is.
            return pyarrow.array(series.to_numpy())
        try:
            return pyarrow.array(series, from_pandas=True)
        except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError, pyarrow.ArrowNotImplementedError):
            return pyarrow.array(_texts(series), pyarrow.string())

    arrays = [array(of) for of in columns]
    return Table.from_arrow(pyarrow.table(arrays, names=[str(of) for of in columns]))


def _of_columns(columns: Iterable[tuple[str, Any]]) -> Table:
    columns = [(name, of) for name, of in columns]
    for name, of in columns[1:]:
        if len(of) != len(columns[0][1]):
            raise RequestError(f"the column `{name}` has {len(of)} rows, and `{columns[0][0]}` has {len(columns[0][1])}")
    return Table.from_columns([(name, *_column(of)) for name, of in columns])


def _column(of: Any) -> tuple[str, Any]:
    """What a column has, and its numbers as bytes or its values as a list."""
    dtype = getattr(of, "dtype", None)
    kind = getattr(dtype, "kind", "O")
    if hasattr(of, "to_numpy"):
        of = of.to_numpy()
    if kind == "f":
        return "float", of.astype("f8").tobytes()
    if kind in "iu":
        return "int", of.astype("i8").tobytes()
    if kind == "b":
        return "bool", of.tolist()
    if kind == "M":
        is_zoned = getattr(dtype, "tz", None) is not None
        ns = of.astype("M8[ns]").astype("i8").tolist()
        none = -(1 << 63)
        return "utc" if is_zoned else "ns", [None if at == none else at for at in ns]
    values = list(of)
    some = [value for value in values if not _is_absent(value)]
    if some and all(isinstance(value, bool) for value in some):
        return "bool", [None if _is_absent(value) else value for value in values]
    if all(isinstance(value, int) for value in some):
        return "int", [None if _is_absent(value) else int(value) for value in values]
    if all(isinstance(value, (int, float)) for value in some):
        return "float", [None if _is_absent(value) else float(value) for value in values]
    if all(isinstance(value, datetime) for value in some):
        zoned = [value.tzinfo is not None for value in some]
        if all(zoned) or not any(zoned):
            which = "utc" if all(zoned) else "ns"
            return which, [None if _is_absent(value) else ns_of(value) for value in values]
    return "text", _texts(values)


def _is_absent(value: Any) -> bool:
    return value is None or (isinstance(value, float) and value != value)


def _texts(values: Iterable[Any]) -> list[str | None]:
    """Cells as a file would have them."""
    return [None if _is_absent(value) else str(value) for value in values]


def ns_of(at: datetime) -> int:
    """An instant in ns since 1970; without a zone, as if its clock were that of UTC."""
    if at.tzinfo is not None:
        at = at.astimezone(timezone.utc).replace(tzinfo=None)
    since = at - _EPOCH
    ns = (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1_000
    return ns + getattr(at, "nanosecond", 0)


def zone_of(name: str | None) -> tzinfo:
    """The zone of a graph, such as `Europe/Berlin` or `+01:00`; UTC where it has none."""
    if name is None:
        return timezone.utc
    if name.startswith(("+", "-")):
        return datetime.fromisoformat(f"2000-01-01T00:00:00{name}").tzinfo or timezone.utc
    return ZoneInfo(name)


def like(given: Any, made: Table) -> Any:
    """A table as the library has it that the data came from."""
    if isinstance(given, (list, tuple)):
        given = given[0]
    library = module_of(given)
    if library == "pandas":
        return to_pandas(made, given)
    if library == "polars":
        return to_polars(made)
    if library == "pyarrow":
        import pyarrow

        whole = pyarrow.table(made)
        if isinstance(given, pyarrow.RecordBatch):
            return whole.to_batches()[0]
        return whole
    if library in ("duckdb", "_duckdb"):
        return sys.modules["duckdb"].from_arrow(made)
    return made


def to_pandas(made: Table, given: Any = None) -> Any:
    import pandas

    try:
        import pyarrow
    except ImportError:
        frame = pandas.DataFrame(
            {
                name: pandas.to_datetime(made.column(name), unit="ns", utc=made.has(name) == "utc")
                if made.has(name) in ("ns", "utc")
                else made.column(name)
                for name in made.column_names
            }
        )
    else:
        frame = pyarrow.table(made).to_pandas()
    # Where a row stands for a row, it goes by the same label.
    if given is not None and len(frame) == len(given):
        frame.index = given.index
    return frame


def to_polars(made: Table) -> Any:
    import polars

    return polars.DataFrame(made)

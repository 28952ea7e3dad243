"""Data frames of any library as tables of Arrow, and back. No library is imported that is not there already."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone, tzinfo
from itertools import chain, groupby
from typing import Any, TypeVar
from zoneinfo import ZoneInfo

from athermal._athermal import Table
from athermal._errors import RequestError
from athermal._progress import Progress, followed

_EPOCH = datetime(1970, 1, 1)
_R = TypeVar("_R")


class Call:
    """What a function of the library is asked for: options, and the tables that names of data among them stand for."""

    def __init__(self, options: Mapping[str, Any], progress: Progress = None) -> None:
        self._options = {name.rstrip("_"): of for name, of in options.items() if of is not None}
        self.tables: list[tuple[str, Table]] = []
        self.progress = followed(progress)
        self.like: Any = None
        """The first frame, which an answer is to be like."""
        self.index: str | None = None
        """The column of the time that is the index of that."""

    @property
    def options(self) -> str:
        """The options as JSON; what has a form of its own goes by its text."""
        return json.dumps(self._options, default=str)

    def set(self, name: str, value: Any) -> None:
        """Gives an option a value."""
        self._options[name] = value

    def run(self, work: Callable[..., _R], *arguments: Any) -> _R:
        """Does what is asked for. Progress that is shown ends with it."""
        try:
            done = work(*arguments, self)
        except BaseException:
            if self.progress:
                self.progress.end(False)
            raise
        if self.progress:
            self.progress.end(True)
        return done


def module_of(of: object) -> str:
    return type(of).__module__.partition(".")[0]


def add_data(
    call: Call,
    given: Any,
    *,
    name: str = "frame",
    option: str = "data",
    columns: Iterable[str] | None = None,
    time: str | None = None,
    times: Sequence[str] | None = (),
) -> None:
    """Adds a frame, the path of a file, a list of them, of which each is a segment of its own, or a generator of pieces of one, to what a
    call reads.

    Only the named columns are looked at, all where none are named. `times` are the columns by which the graph knows the time, and `time`
    is the one that stands for it. It may be the index of a frame of pandas.
    """
    names_of_data: list[str] = []
    several = isinstance(given, (list, tuple))
    if several and not given:
        raise TypeError("the list of frames is empty")
    renamed = {time: times[0]} if time is not None and times and [time] != list(times) else {}
    for nth, one in enumerate(given if several else [given]):
        if isinstance(one, (str, os.PathLike)):
            names_of_data.append(os.fspath(one))
            continue
        its_name = f"{name}[{nth}]" if several else name
        names_of_data.append(its_name)
        wanted = None if columns is None else [*(of for of in columns if of not in renamed.values()), *renamed]
        its_table, first = _pieces(one, wanted, time, times) if _is_generator(one) else (table(one, wanted, time, times), one)
        if call.like is None:
            call.like, call.index = first, index_name(first, time, times)
        there = its_table.column_names
        if renamed and time not in there:
            raise RequestError(f"{its_name}: there is no column `{time}`; found {', '.join(f'`{of}`' for of in there)}")
        if renamed:
            its_table = its_table.renamed(renamed)
        call.tables.append((its_name, its_table))
    call.set(option, names_of_data)
    if several and len(given) > 1:
        call.set("segments", True)


def _is_generator(of: Any) -> bool:
    return isinstance(of, Iterator) and not hasattr(of, "__arrow_c_stream__")


def _pieces(given: Iterator[Any], wanted: Iterable[str] | None, time: str | None, times: Sequence[str] | None) -> tuple[Table, Any]:
    """The table of a generator of frames, or of rows that are dicts, and the first of what it gave."""
    tables, first = [], None

    def is_row(of: Any) -> bool:
        return isinstance(of, Mapping) and all(isinstance(value, str) or not hasattr(value, "__len__") for value in of.values())

    for of_rows, some in groupby(given, is_row):
        pieces: Iterable[Any] = some
        if of_rows:
            rows = list(some)
            names = dict.fromkeys(chain.from_iterable(rows))
            pieces = [{of: [row.get(of) for row in rows] for of in names}]
        for piece in pieces:
            if isinstance(piece, (str, os.PathLike)):
                raise RequestError("a generator gives pieces of one recording: frames, or rows as dicts. Give paths as a list")
            first = piece if first is None else first
            tables.append(table(piece, wanted, time, times))
    if not tables:
        raise RequestError("the generator gave nothing")
    try:
        return (tables[0] if len(tables) == 1 else Table.joined(tables)), first
    except ValueError as error:
        raise RequestError(f"the pieces of a generator are one recording: {error}") from None


def index_name(frame: Any, time: str | None, times: Sequence[str] | None) -> str | None:
    """The column that the index of a frame of pandas is: one that has its name, or that of the time where it has dates. `None` of a frame
    that has this column, and of any other library. Without `times` nobody knows a name."""
    if module_of(frame) != "pandas" or not hasattr(type(frame), "columns"):
        return None
    index, there = frame.index, set(frame.columns)
    of_dates = index.nlevels == 1 and getattr(index.dtype, "kind", "O") == "M"
    if times is None and time is None:
        name = index.name or "time"
        return str(name) if of_dates and name not in there else None
    if time is None:
        time = times[0] if times and len(times) == 1 else None
        if time is None or time in there:
            return None
        return time if time in index.names or of_dates else None
    return time if time not in there and (time in index.names or of_dates and index.name is None) else None


def table(frame: Any, wanted: Iterable[str] | None = None, time: str | None = None, times: Sequence[str] | None = ()) -> Table:
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
        # What is no number, instant or text for Arrow is one for polars nevertheless.
        polars = sys.modules["polars"]
        kinds = {name: str(of).partition("(")[0] for name, of in frame.schema.items()}
        frame = frame.with_columns(
            [polars.lit(None, polars.Float64).alias(of) for of, kind in kinds.items() if kind == "Null"]
            + [polars.col(of).cast(polars.Float64) for of, kind in kinds.items() if kind in ("Int128", "UInt128", "Float16")]
            + [polars.Series(of, _texts(frame[of].to_list()), polars.String) for of, kind in kinds.items() if kind == "Object"]
        )
    elif library in ("duckdb", "_duckdb"):
        if not hasattr(frame, "columns"):
            return _of_connection(frame, wanted)
        # Columns are named as they are, whatever signs they have.
        there = _there(frame.columns, wanted)
        if there and len(there) < len(frame.columns):
            frame = frame.project(", ".join('"' + of.replace('"', '""') + '"' for of in there))
        if "pyarrow" not in sys.modules and not _can_import("pyarrow"):
            return _of_columns(frame.fetchnumpy().items())
    elif library == "pyarrow" and hasattr(frame, "scanner"):
        frame = frame.scanner(columns=_there(frame.schema.names, wanted)).to_reader()
    elif library == "pyarrow" and hasattr(frame, "to_reader") and not hasattr(frame, "__arrow_c_stream__"):
        frame = frame.to_reader()
    elif library == "pandas":
        index = index_name(frame, time, times)
        return _of_pandas(frame, _there([*frame.columns, *([] if index is None else [index])], wanted), index)
    elif isinstance(frame, Mapping):
        return _of_columns((of, frame[of]) for of in _there(list(frame), wanted))
    elif library == "numpy" and getattr(frame.dtype, "names", None):
        return _of_columns((of, frame[of]) for of in _there(frame.dtype.names, wanted))
    if library != "one column" and (hasattr(frame, "__arrow_c_stream__") or hasattr(frame, "__arrow_c_array__")):
        return Table.from_arrow(frame)
    kind = type(frame)
    raise TypeError(
        f"{kind.__module__}.{kind.__qualname__} is no data frame: give one of pandas, polars, pyarrow or DuckDB, anything with "
        "`__arrow_c_stream__`, a dict of columns, the path of a file, a list of these, or a generator of pieces"
    )


def _can_import(name: str) -> bool:
    try:
        __import__(name)
    except ImportError:
        return False
    return True


def _of_connection(connection: Any, wanted: Iterable[str] | None) -> Table:
    """The result that a connection of DuckDB has: of `connection.execute("select …")`."""
    names = [of[0] for of in connection.description or []]
    try:
        found = connection.fetchnumpy() if names and not _can_import("pyarrow") else names and _reader(connection)()
    except Exception as error:
        raise RequestError(f"the connection has no rows to give: {error}") from error
    if not names:
        raise RequestError('the connection has no result: give `connection.execute("select …")` or `connection.table("…")`')
    if isinstance(found, Mapping):
        return _of_columns((of, found[of]) for of in _there(names, wanted))
    return Table.from_arrow(found).only(_there(names, wanted))


def _reader(connection: Any) -> Callable[[], Any]:
    """What gives its result by pyarrow, whichever name this version of DuckDB has for it."""
    names = ("to_arrow_reader", "fetch_record_batch", "arrow")
    found: Callable[[], Any] = next(getattr(connection, name) for name in names if hasattr(connection, name))
    return found


def _there(columns: Sequence[Any], wanted: Iterable[str] | None) -> list[Any]:
    if wanted is None:
        return list(columns)
    wanted = set(wanted)
    found = [of for of in columns if of in wanted]
    # A frame without any of them is still one with rows, and its names are told apart in messages.
    return found if len(found) == len(wanted) else list(columns)


def _of_pandas(frame: Any, columns: list[Any], index: str | None) -> Table:
    twice = [of for nth, of in enumerate(columns) if of in columns[:nth]]
    if twice:
        raise RequestError(f"two columns have the name `{twice[0]}`: give one of them another")

    def series(of: Any) -> Any:
        if of != index:
            return frame[of]
        level = frame.index.get_level_values(of) if of in frame.index.names else frame.index
        return level.to_series(index=range(len(level)))

    return _of_columns((str(of), series(of)) for of in columns)


def _of_columns(columns: Iterable[tuple[str, Any]]) -> Table:
    columns = [(name, of) for name, of in columns]
    for name, of in columns[1:]:
        if len(of) != len(columns[0][1]):
            raise RequestError(f"the column `{name}` has {len(of)} rows, and `{columns[0][0]}` has {len(columns[0][1])}")
    return Table.from_columns([(name, *_column(of)) for name, of in columns])


def _column(of: Any) -> tuple[str, Any]:
    """What a column has, and it, as `Table.from_columns` takes both: of pandas, of numpy, or a list.

    Whether pyarrow is there makes no difference but that numbers need no copy then.
    """
    dtype = getattr(of, "dtype", None)
    if module_of(dtype) == "numpy":
        return _of_numpy(of if module_of(of) == "numpy" else of.to_numpy())
    if dtype is not None and module_of(of) == "pandas":
        name = type(dtype).__name__
        if name == "DatetimeTZDtype":
            return f"{dtype.unit} {_zone_name(dtype.tz)}", of.dt.tz_convert("UTC").dt.tz_localize(None).to_numpy().view("i8").tobytes()
        if name == "SparseDtype":
            return _column(of.sparse.to_dense())
        if (name == "ArrowDtype" or getattr(dtype, "storage", "") == "pyarrow") and _can_import("pyarrow"):
            return "arrow", _one_array(of)
        if hasattr(dtype, "numpy_dtype"):
            mask, values = of.isna().to_numpy(), of.array.to_numpy(dtype=dtype.numpy_dtype, na_value=dtype.type(0))
            return _of_numpy(values, mask)
        of = of.astype(object)
    return _of_values(list(of))


def _of_numpy(of: Any, mask: Any = None) -> tuple[str, Any]:
    kind = of.dtype.kind
    if hasattr(of, "mask"):
        mask = of.mask if getattr(of.mask, "ndim", 0) else None
        of = of.data
    if mask is not None and not mask.any():
        mask = None
    if kind == "M":
        unit = str(of.dtype).partition("[")[2].rstrip("]")
        unit = unit if unit in ("s", "ms", "us", "ns") else "s" if unit in ("Y", "M", "W", "D", "h", "m") else "ns"
        return unit, _packed(of.astype(f"M8[{unit}]").view("i8"), mask)
    if kind in "iu" and (kind == "i" or not len(of) or of.max() < 1 << 63):
        return ("int", _packed(of.astype("i8"), mask)) if mask is not None or of.dtype != "i8" else _number("int", of)
    if kind in "fu":
        return ("float", _packed(of.astype("f8"), mask)) if mask is not None or of.dtype != "f8" else _number("float", of)
    if kind == "b" and mask is None:
        return "bool", of.tolist()
    return _of_values([None if absent else value for value, absent in zip(of.tolist() if kind == "b" else of, _or_none(mask, len(of)))])


def _or_none(mask: Any, length: int) -> Iterable[bool]:
    return [False] * length if mask is None else mask.tolist()


def _packed(values: Any, mask: Any) -> Any:
    return values.tobytes() if mask is None else (values.tobytes(), mask.astype("u1").tobytes())


def _number(kind: str, of: Any) -> tuple[str, Any]:
    """Numbers of 64 bits, by pyarrow where it is installed: without a copy, and without a look at what is NaN, which is absent as null is."""
    if of.dtype.isnative and of.ndim == 1 and _can_import("pyarrow"):
        return "arrow", sys.modules["pyarrow"].array(of)
    return kind, of.astype("f8" if kind == "float" else "i8").tobytes()


def _one_array(of: Any) -> Any:
    """A column that pandas keeps by pyarrow, as one array of numbers, instants or texts."""
    pyarrow = sys.modules["pyarrow"]
    array = pyarrow.array(of, from_pandas=True)
    if isinstance(array, pyarrow.ChunkedArray):
        array = array.combine_chunks()
    types = pyarrow.types
    if types.is_dictionary(array.type):
        array = array.dictionary_decode()
    if types.is_null(array.type):
        return array.cast(pyarrow.float64())
    if types.is_duration(array.type) or types.is_time(array.type):
        return pyarrow.array(_texts(of.astype(object)), pyarrow.string())
    return array.cast(pyarrow.string()) if str(array.type) == "string_view" else array


def _of_values(values: list[Any]) -> tuple[str, Any]:
    values = [_plain(value) for value in values]
    some = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in some):
        return ("bool" if some else "float"), values
    if all(isinstance(value, int) and -(1 << 63) <= value < 1 << 63 for value in some):
        return "int", [value if value is None else int(value) for value in values]
    if all(isinstance(value, (int, float)) for value in some):
        return "float", [value if value is None else float(value) for value in values]
    if all(isinstance(value, datetime) for value in some):
        zoned = [value.tzinfo is not None for value in some]
        if all(zoned) or not any(zoned):
            return ("ns UTC" if all(zoned) else "ns"), [value if value is None else ns_of(value) for value in values]
    return "text", _texts(values)


def _plain(value: Any) -> Any:
    """A value as Python has it; `None` where it is absent: NaN, NaT and NA are that too."""
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return None
    if module_of(value) == "numpy" and hasattr(value, "item"):
        if value.dtype.kind == "M":
            at = value.astype("M8[us]").item()
            return at if at is None or isinstance(at, datetime) else datetime(at.year, at.month, at.day)
        value = value.item() if value.dtype.kind in "biuf" else None if str(value) == "NaT" else value
    # A Decimal that is no number may not be compared.
    is_nan = getattr(value, "is_nan", None)
    return None if (is_nan() if callable(is_nan) else isinstance(value, float) and value != value) else value


def _texts(values: Iterable[Any]) -> list[str | None]:
    """Cells as a file would have them."""
    return [None if of is None else str(of) for of in map(_plain, values)]


def ns_of(at: datetime) -> int:
    """An instant in ns since 1970; without a zone, as if its clock were that of UTC."""
    if at.tzinfo is not None:
        at = at.astimezone(timezone.utc).replace(tzinfo=None)
    since = at - _EPOCH
    ns = (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1_000
    return ns + int(getattr(at, "nanosecond", 0))


def zone_of(name: str | None) -> tzinfo:
    """The zone of a graph, such as `Europe/Berlin` or `+01:00`; UTC where it has none."""
    if name is None:
        return timezone.utc
    if name.startswith(("+", "-")):
        return datetime.fromisoformat(f"2000-01-01T00:00:00{name}").tzinfo or timezone.utc
    return ZoneInfo(name)


def _zone_name(zone: Any) -> str:
    """A zone as Arrow calls it: `Europe/Berlin` or `+01:00`."""
    name = getattr(zone, "key", None) or getattr(zone, "zone", None)
    if name:
        return str(name)
    off = zone.utcoffset(None)
    if not off:
        return "UTC"
    minutes = round(off.total_seconds() / 60)
    return f"{'-' if minutes < 0 else '+'}{abs(minutes) // 60:02}:{abs(minutes) % 60:02}"


def like(call: Call, made: Table) -> Any:
    """A table as the library has it that the data of a call came from."""
    given = call.like
    library = module_of(given)
    if library == "pandas":
        return to_pandas(made, given, call.index)
    if library == "polars":
        return to_polars(made)
    if library == "pyarrow":
        import pyarrow

        whole = pyarrow.table(made)
        if isinstance(given, pyarrow.RecordBatch):
            return pyarrow.RecordBatch.from_arrays([of.combine_chunks() for of in whole.columns], names=whole.column_names)
        return whole
    if library in ("duckdb", "_duckdb") and _can_import("pyarrow"):
        return (sys.modules["duckdb"] if hasattr(given, "columns") else given).from_arrow(made)
    return made


def to_pandas(made: Table, given: Any = None, index: str | None = None) -> Any:
    import pandas

    def series(name: str) -> Any:
        clock, values = made.clock(name), made.column(name)
        if clock is None:
            return pandas.Series(values, dtype=float if made.has(name) == "float" else None)
        unit, zone = clock
        found = pandas.Series(pandas.to_datetime(values, unit="ns", utc=zone is not None))
        found = found.dt.as_unit(unit) if hasattr(found.dt, "as_unit") else found
        return found if zone is None else found.dt.tz_convert(zone)

    if _can_import("pyarrow"):
        frame = sys.modules["pyarrow"].table(made).to_pandas()
    else:
        frame = pandas.DataFrame({name: series(name) for name in made.column_names})
    if index is not None:
        time = made.column_names[0]
        return frame.set_index(time).rename_axis(index=given.index.name if given.index.nlevels == 1 else index)
    # Where a row stands for a row, it goes by the same label.
    if given is not None and len(frame) == len(given):
        frame.index = given.index
    return frame


def to_polars(made: Table) -> Any:
    import polars

    return polars.DataFrame(made)

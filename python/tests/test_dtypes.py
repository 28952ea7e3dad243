"""Columns of every type are read to the same values, whichever library has them and whether pyarrow is installed.

Each is stated with what it is to be read as, so that environments that have other versions agree by agreeing with the table.
"""

from __future__ import annotations

import sys
import warnings
from datetime import datetime, timedelta, timezone
from decimal import Decimal
from zoneinfo import ZoneInfo

import pytest

import athermal

GRAPH = """
schema = 1

[time]
column = "at"
unit = "UNIT"

[signals.x]
unit = "1"
channels = ["value"]
column = "{channel}"
max_age = "1h"

[outputs]
out = "x"
"""

BIG = (1 << 60) + 1
START = datetime(2026, 3, 28, 23, 30, tzinfo=timezone.utc)
"""Half an hour before a clock in Berlin goes an hour forward."""
NAIVE = [(START + timedelta(hours=of)).replace(tzinfo=None) for of in range(4)]
NS = [int((START + timedelta(hours=of)).timestamp()) * 10**9 for of in range(4)]

# By a function of pandas: a column of values, and what they are.
VALUES = {
    **{
        f"{kind}{size}": (lambda pd, of=f"{kind}{size}": pd.Series([1, 2, 0, 3], dtype=of), [1, 2, 0, 3])
        for kind in ("int", "uint")
        for size in (8, 16, 32, 64)
    },
    **{f"float{size}": (lambda pd, of=f"float{size}": pd.Series([1.5, None, 0, -2], dtype=of), [1.5, None, 0, -2]) for size in (16, 32, 64)},
    "a uint64 that no int64 is": (lambda pd: pd.Series([2**63 + 2048, 1, 2, 3], dtype="uint64"), [2.0**63 + 2048, 1, 2, 3]),
    "bool": (lambda pd: pd.Series([True, False, True, True]), [1, 0, 1, 1]),
    "boolean": (lambda pd: pd.Series([True, None, False, True], dtype="boolean"), [1, None, 0, 1]),
    "Int64": (lambda pd: pd.Series([1, None, 0, 3], dtype="Int64"), [1, None, 0, 3]),
    "Int64 that is large": (lambda pd: pd.Series([BIG, None, 0, 3], dtype="Int64"), [float(BIG), None, 0, 3]),
    "UInt8": (lambda pd: pd.Series([1, None, 0, 255], dtype="UInt8"), [1, None, 0, 255]),
    "Float32": (lambda pd: pd.Series([1.5, None, 0, 3], dtype="Float32"), [1.5, None, 0, 3]),
    "Float64": (lambda pd: pd.Series([1.5, None, 0, 3], dtype="Float64"), [1.5, None, 0, 3]),
    "string": (lambda pd: pd.Series(["1.5", None, "0", "-2"], dtype="string"), [1.5, None, 0, -2]),
    "str": (lambda pd: pd.Series(["1.5", "1", "0", "-2"]), [1.5, 1, 0, -2]),
    "object of texts": (lambda pd: pd.Series(["1.5", None, "0", float("nan")], dtype=object), [1.5, None, 0, None]),
    "object of numbers": (lambda pd: pd.Series([1, None, 0.5, pd.NA], dtype=object), [1, None, 0.5, None]),
    "object of whole numbers": (lambda pd: pd.Series([1, None, 0, pd.NaT], dtype=object), [1, None, 0, None]),
    "object of truth values": (lambda pd: pd.Series([True, None, False, True], dtype=object), [1, None, 0, 1]),
    "object of decimals": (lambda pd: pd.Series([Decimal("1.5"), None, Decimal("NaN"), Decimal(2)], dtype=object), [1.5, None, None, 2]),
    "object of everything": (lambda pd: pd.Series([True, 2, "0.5", None], dtype=object), [1, 2, 0.5, None]),
    "object of nothing": (lambda pd: pd.Series([None] * 4, dtype=object), [None] * 4),
    "category of texts": (lambda pd: pd.Series(["1.5", None, "0", "1.5"]).astype("category"), [1.5, None, 0, 1.5]),
    "category of whole numbers": (lambda pd: pd.Series([1, None, 0, 1], dtype="Int64").astype("category"), [1, None, 0, 1]),
    "category of numbers": (lambda pd: pd.Series([1.5, None, 0, 1.5]).astype("category"), [1.5, None, 0, 1.5]),
    # What is no number is unreadable, which is absent here; it is no figure in any unit.
    "timedelta64": (lambda pd: pd.Series(pd.to_timedelta([1, None, 0, 3], unit="s")), [None] * 4),
    "complex": (lambda pd: pd.Series([1 + 2j, 0, 0, 3]), [None] * 4),
    "sparse": (lambda pd: pd.Series([0.0, None, 0.0, 3.0], dtype=pd.SparseDtype("float64", 0.0)), [0, None, 0, 3]),
}
BERLIN = "Europe/Berlin"
OFF = timezone(timedelta(hours=-3, minutes=-30))
# The same of times, and the instants that they are; the last is of a row whose time is absent, which is left out.
TIMES = {
    **{f"datetime64[{unit}]": (lambda pd, of=unit: pd.Series(pd.to_datetime(NAIVE)).astype(f"datetime64[{of}]"), NS) for unit in ("s", "ms", "us", "ns")},
    "datetime64 with NaT": (lambda pd: pd.Series(pd.to_datetime([*NAIVE[:3], None])), NS[:3]),
    "of Berlin": (lambda pd: pd.Series(pd.to_datetime(NAIVE)).dt.tz_localize("UTC").dt.tz_convert(BERLIN), NS),
    "of Berlin with NaT": (lambda pd: pd.Series(pd.to_datetime([*NAIVE[:3], None])).dt.tz_localize("UTC").dt.tz_convert(BERLIN), NS[:3]),
    "of an offset": (lambda pd: pd.Series(pd.to_datetime(NAIVE)).dt.tz_localize("UTC").dt.tz_convert(OFF), NS),
    "object of dates with zones": (lambda pd: pd.Series([of.replace(tzinfo=timezone.utc).astimezone(ZoneInfo(BERLIN)) for of in NAIVE], dtype=object), NS),
    "object of dates and NaT": (lambda pd: pd.Series([*NAIVE[:3], pd.NaT], dtype=object), NS[:3]),
    "texts": (lambda pd: pd.Series([of.isoformat() + "Z" for of in NAIVE]), NS),
    "int64 of seconds": (lambda pd: pd.Series([of // 10**9 for of in NS]), NS),
    "Int64 of seconds, of which one is NA": (lambda pd: pd.Series([*(of // 10**9 for of in NS[:3]), None], dtype="Int64"), NS[:3]),
    "float64 of seconds": (lambda pd: pd.Series([of / 1e9 for of in NS]), NS),
}
# Types of pandas that only pyarrow makes.
OF_ARROW = {
    "int64[pyarrow]": (lambda pd: pd.Series([1, None, 0, 3], dtype="int64[pyarrow]"), [1, None, 0, 3]),
    "double[pyarrow]": (lambda pd: pd.Series([1.5, None, 0, 3], dtype="double[pyarrow]"), [1.5, None, 0, 3]),
    "bool[pyarrow]": (lambda pd: pd.Series([True, None, False, True], dtype="bool[pyarrow]"), [1, None, 0, 1]),
    "string[pyarrow]": (lambda pd: pd.Series(["1.5", None, "0", "3"], dtype="string[pyarrow]"), [1.5, None, 0, 3]),
    "decimal of pyarrow": (lambda pd: pd.Series([Decimal("1.5"), None, Decimal(0), Decimal(3)], dtype=_decimal(pd)), [1.5, None, 0, 3]),
    "dictionary of pyarrow": (lambda pd: pd.Series(["1.5", None, "0", "1.5"], dtype="string[pyarrow]").astype("category"), [1.5, None, 0, 1.5]),
}


def _decimal(pd):
    import pyarrow

    return pd.ArrowDtype(pyarrow.decimal128(10, 2))


def read(frame, unit="s"):
    """The instants of the rows that are taken, in ns, and their values."""
    graph = athermal.Graph(GRAPH.replace("UNIT", unit))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read = athermal.Frame(athermal._frames.table(frame, ["at", "value"], None, ["at"]))
        predicted = graph.model().predict(read, lenient=True)
    # Of a frame, never of each row; and none of pandas or numpy.
    assert len(caught) <= 2 and all(of.category is athermal.AthermalWarning for of in caught), [str(of.message) for of in caught]
    at = predicted["at"]
    if predicted._table.has("at") == "text":
        at = [int(datetime.fromisoformat(of.replace("Z", "+00:00")).timestamp()) * 10**9 for of in at]
    elif predicted._table.has("at") != "instants":
        at = [round(of * 10**9) for of in at]
    return at, predicted["out.value"]


def ways(monkeypatch, column=None):
    """With pyarrow, where it is installed, and without it, unless it is what has the column."""
    try:
        import pyarrow  # noqa: F401

        yield "with pyarrow"
    except ImportError:
        pass
    of = getattr(column, "dtype", None)
    if "pyarrow" in (getattr(of, "storage", ""), getattr(getattr(getattr(of, "categories", None), "dtype", None), "storage", "")):
        return
    with monkeypatch.context() as patched:
        patched.setitem(sys.modules, "pyarrow", None)
        yield "without pyarrow"


@pytest.mark.parametrize("name", VALUES)
def test_values_of_pandas(name, monkeypatch):
    pandas = pytest.importorskip("pandas")
    make, expected = VALUES[name]
    column = make(pandas)
    for way in ways(monkeypatch, column):
        assert read(pandas.DataFrame({"at": range(4), "value": column})) == ([0, 10**9, 2 * 10**9, 3 * 10**9], expected), way
        # The row labels are nobody's business, nor are those that are left out.
        frame = pandas.DataFrame({"at": range(4), "value": column, "other": object()}).set_axis([3, 3, 1, 2])
        assert read(frame)[1] == expected, way
        assert read({"at": list(range(4)), "value": column})[1] == expected, way
        assert read(frame[:0])[1] == []


@pytest.mark.parametrize("name", TIMES)
def test_times_of_pandas(name, monkeypatch):
    pandas = pytest.importorskip("pandas")
    make, expected = TIMES[name]
    unit = "rfc3339" if name == "texts" else "s"
    column = make(pandas)
    for way in ways(monkeypatch, column):
        frame = pandas.DataFrame({"at": column, "value": [1.0, 2.0, 3.0, 4.0]})
        found = read(frame, unit)
        assert found == (expected, [1.0, 2.0, 3.0, 4.0][: len(expected)]), way
        if len(expected) == 4:
            # As an index they are the same.
            assert read(frame.set_index("at"), unit) == found, way


def test_an_answer_has_the_times_that_the_frame_had(monkeypatch):
    pandas = pytest.importorskip("pandas")
    model = athermal.Graph(GRAPH.replace("UNIT", "s")).model()
    for way in ways(monkeypatch):
        for name, (make, expected) in TIMES.items():
            column = make(pandas)
            if len(expected) == 4 and "object" not in name and name != "texts":
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    answer = model.predict(pandas.DataFrame({"at": column, "value": 1.0}))["at"]
                # An offset has a class of its own in some versions.
                assert answer.dtype == column.dtype or name == "of an offset", (name, way)
                assert answer.tolist() == column.tolist() and str(answer[0]) == str(column[0]), (name, way)


@pytest.mark.parametrize("name", OF_ARROW)
def test_values_of_pandas_that_pyarrow_keeps(name):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    make, expected = OF_ARROW[name]
    assert read(pandas.DataFrame({"at": range(4), "value": make(pandas)}))[1] == expected


def test_values_of_polars():
    polars = pytest.importorskip("polars")
    whole = [polars.Int8, polars.Int16, polars.Int32, polars.Int64, polars.UInt8, polars.UInt16, polars.UInt32, polars.UInt64]
    cases = {str(of): (polars.Series([1, None, 0, 3], dtype=of), [1, None, 0, 3]) for of in whole}
    cases |= {str(of): (polars.Series([1.5, None, 0, 3], dtype=of), [1.5, None, 0, 3]) for of in (polars.Float32, polars.Float64)}
    cases |= {
        "a UInt64 that no Int64 is": (polars.Series([2**63 + 2048, 1, 2, 3], dtype=polars.UInt64), [2.0**63 + 2048, 1, 2, 3]),
        "Int128": (polars.Series([1, None, 0, 3], dtype=polars.Int128), [1, None, 0, 3]),
        "Boolean": (polars.Series([True, None, False, True]), [1, None, 0, 1]),
        "String": (polars.Series(["1.5", None, "0", "3"]), [1.5, None, 0, 3]),
        "Categorical": (polars.Series(["1.5", None, "0", "1.5"], dtype=polars.Categorical), [1.5, None, 0, 1.5]),
        "Enum": (polars.Series(["1.5", None, "0", "1.5"], dtype=polars.Enum(["1.5", "0"])), [1.5, None, 0, 1.5]),
        "Decimal": (polars.Series([Decimal("1.5"), None, Decimal(0), Decimal(3)]), [1.5, None, 0, 3]),
        "Object": (polars.Series([1.5, None, "0", True], dtype=polars.Object), [1.5, None, 0, 1]),
        "Null": (polars.Series([None] * 4), [None] * 4),
        "NaN": (polars.Series([1.5, float("nan"), 0.0, None]), [1.5, None, 0, None]),
    }
    for name, (column, expected) in cases.items():
        frame = polars.DataFrame({"at": [0, 1, 2, 3], "value": column})
        assert read(frame)[1] == expected, name
        assert read(frame.lazy())[1] == expected, name
    for unit in ("ms", "us", "ns"):
        for zone in (None, "UTC", BERLIN):
            at = polars.Series(NAIVE, dtype=polars.Datetime(unit))
            at = at if zone is None else at.dt.replace_time_zone("UTC").dt.convert_time_zone(zone)
            assert read(polars.DataFrame({"at": at, "value": [1.0, 2.0, 3.0, 4.0]})) == (NS, [1.0, 2.0, 3.0, 4.0]), (unit, zone)


def test_values_of_lists_and_of_numpy():
    frame = {"at": [0, 1, 2, 3]}
    assert read({**frame, "value": [True, None, 2, 0.5]})[1] == [1, None, 2, 0.5]
    assert read({**frame, "value": [2**70, 1, None, 0]})[1] == [2.0**70, 1, None, 0]
    numpy = pytest.importorskip("numpy")
    for of in ("i1", "i2", "i4", "i8", "u1", "u8", "f2", "f4", "f8", ">f8", ">i4"):
        assert read({**frame, "value": numpy.array([1, 2, 0, 3], of)})[1] == [1, 2, 0, 3], of
    every_other = numpy.arange(8.0)[::2]
    assert read({**frame, "value": every_other})[1] == [0, 2, 4, 6]
    assert read({**frame, "value": numpy.ma.masked_array([1.0, 2.0, 0.0, 3.0], [0, 1, 0, 0])})[1] == [1, None, 0, 3]
    assert read({**frame, "value": [numpy.float32(1.5), numpy.int8(2), numpy.bool_(True), None]})[1] == [1.5, 2, 1, None]
    for unit in ("s", "ms", "us", "ns", "m"):
        assert read({"at": numpy.array(NAIVE, f"M8[{unit}]"), "value": [1.0] * 4})[0] == NS, unit
    assert read({"at": [numpy.datetime64(of) for of in NAIVE], "value": [1.0] * 4})[0] == NS

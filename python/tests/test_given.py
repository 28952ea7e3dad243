"""What data may be, beside frames with a column of the time."""

from __future__ import annotations

import math
import warnings

import pytest

import athermal
from conftest import parts
from test_frames import DATED, dated, small


@pytest.fixture
def expected(graph):
    return parts(graph.fit(small()))


def test_the_index_of_a_frame_of_pandas_is_the_time(graph, expected):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(small()).set_index("time_s")
    model = graph.fit(frame)
    assert parts(model) == expected
    predicted = model.predict(frame)
    assert predicted.index.equals(frame.index) and list(predicted.columns) == ["predicted.Z1", "predicted.Z2"]
    by_column = model.predict(frame.reset_index())
    assert predicted["predicted.Z1"].tolist()[-1] == by_column["predicted.Z1"].tolist()[-1] and "time_s" in by_column
    assert parts(graph.fit(frame.rename_axis("when"), time="when")) == expected
    # A frame has the column of the time, and its index is nothing then.
    assert parts(graph.fit(frame.reset_index().set_index("room_degC", drop=False))) == expected
    with pytest.raises(athermal.RequestError, match="time_s"):
        graph.fit(frame.rename_axis("when"))
    with pytest.raises(athermal.RequestError, match="there is no column `nope`"):
        graph.fit(frame, time="nope")


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
def test_an_index_of_dates_is_the_time_whatever_it_is_called(zone):
    pandas = pytest.importorskip("pandas")
    from datetime import timezone

    graph = athermal.Graph(DATED)
    frame = pandas.DataFrame(dated(timezone.utc)).set_index("when")
    frame.index = frame.index.tz_localize(None) if zone is None else frame.index.tz_convert(zone)
    expected = parts(graph.fit(dated(timezone.utc)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in ("when", "Timestamp", None):
            its = frame.rename_axis(name)
            model = graph.fit(its)
            assert parts(model) == expected, name
            answer = model.predict(its)
            assert answer.index.equals(its.index) and answer.index.name == name and answer.index.dtype == its.index.dtype
        levels = frame.assign(machine="m").set_index("machine", append=True)
        assert parts(graph.fit(levels)) == expected
        starter = athermal.init(frame.rename_axis(None))
    assert starter.columns[0] == "time" and starter.fit(frame.rename_axis(None)).report.estimators


def test_a_lazy_frame_and_a_dataset_give_the_columns_that_are_read(graph, expected, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    dataset = pytest.importorskip("pyarrow.dataset")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = pyarrow.table({**small(), "unread": [[nth] for nth in range(len(small()["time_s"]))]})
    for nth in range(2):
        parquet.write_table(table.slice(200 * nth, 200), tmp_path / f"{nth}.parquet")
    of_files = dataset.dataset(str(tmp_path))
    model = graph.fit(of_files)
    assert parts(model) == expected
    assert isinstance(model.predict(of_files), pyarrow.Table)
    assert parts(graph.fit(of_files.scanner())) == expected
    assert parts(graph.fit(table.to_reader(100))) == expected
    with pytest.raises(athermal.RequestError, match="`room_degC`"):
        graph.fit(dataset.dataset(table.drop_columns("room_degC")))
    polars = pytest.importorskip("polars")
    lazy = polars.scan_parquet(tmp_path / "*.parquet")
    assert parts(graph.fit(lazy)) == expected
    assert isinstance(graph.fit(lazy).predict(lazy), polars.DataFrame)


def pieces(columns, length=150):
    for begin in range(0, len(columns["time_s"]), length):
        yield {name: of[begin : begin + length] for name, of in columns.items()}


def test_a_generator_gives_pieces_of_one_recording(graph, expected, tmp_path):
    columns = small()
    assert parts(graph.fit(pieces(columns))) == expected
    rows = (dict(zip(columns, row)) for row in zip(*columns.values()))
    assert parts(graph.fit(rows)) == expected
    of_frames = (athermal.Frame(athermal._frames.table(piece)) for piece in pieces(columns))
    model = graph.fit(of_frames)
    assert isinstance(model.predict(pieces(columns)), athermal.Frame)
    assert len(model.predict(pieces(columns))) == len(columns["time_s"])
    when = {("when" if name == "time_s" else name): of for name, of in columns.items()}
    assert parts(graph.fit(iter([when]), time="when")) == expected
    # A list of generators is one of segments, as of frames.
    halves = [pieces({name: of[:200] for name, of in columns.items()}), pieces({name: of[200:] for name, of in columns.items()})]
    assert parts(graph.fit(halves)) != expected
    with pytest.raises(athermal.RequestError, match="gave nothing"):
        graph.fit(iter([]))
    with pytest.raises(athermal.RequestError, match="piece 2 differs from the first"):
        graph.fit(iter([columns, {name: [str(value) for value in of] for name, of in columns.items()}]))
    with pytest.raises(athermal.RequestError, match="Give paths as a list"):
        graph.fit(str(path) for path in [tmp_path / "a.csv"])
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(columns)
    assert parts(graph.fit(frame[begin : begin + 100] for begin in range(0, len(frame), 100))) == expected
    frame.to_csv(tmp_path / "a.csv", index=False)
    with pandas.read_csv(tmp_path / "a.csv", chunksize=90, float_precision="round_trip") as chunks:
        model = graph.fit(chunks)
    assert parts(model) == expected
    assert isinstance(model.predict(frame[:100] for _ in range(1)), pandas.DataFrame)


def test_the_result_of_a_connection_of_duckdb_is_data(graph, expected, monkeypatch):
    duckdb = pytest.importorskip("duckdb")
    pyarrow = pytest.importorskip("pyarrow")
    log = pyarrow.table({**small(), "other col": [nth for nth in range(len(small()["time_s"]))]})
    connection = duckdb.connect()
    connection.register("log", log)
    model = graph.fit(connection.execute("select * from log order by time_s"))
    assert parts(model) == expected
    predicted = model.predict(connection.execute("select * from log"))
    assert isinstance(predicted, duckdb.DuckDBPyRelation) and len(predicted.fetchall()) == log.num_rows
    assert parts(graph.fit(connection.table("log"))) == expected
    assert parts(graph.fit(connection.sql("from log"))) == expected
    with pytest.raises(athermal.RequestError, match="no result: give `connection.execute"):
        graph.fit(duckdb.connect())
    # Without pyarrow it is numpy that comes between.
    connection.execute("create table kept as from log")
    with monkeypatch.context() as patched:
        import sys

        patched.setitem(sys.modules, "pyarrow", None)
        assert parts(graph.fit(connection.execute("from kept"))) == expected
        assert parts(graph.fit(connection.table("kept"))) == expected
        assert isinstance(model.predict(connection.table("kept")), athermal.Frame)


def test_a_frame_is_looked_at_cut_walked_through_and_pickled():
    import pickle

    frame = athermal.simulate("die-tester", days=0.02)
    names, rows = frame.columns, len(frame)
    assert frame[0]["time_s"] == 0.0 and frame[-1] == frame[rows - 1] and list(frame[0]) == names
    assert frame[10:20]["time_s"] == frame["time_s"][10:20] and isinstance(frame[10:20], athermal.Frame)
    assert frame[::7].to_dict() == {name: of[::7] for name, of in frame.to_dict().items()}
    assert frame[::-1]["room_degC"] == frame["room_degC"][::-1] and len(frame[5:2]) == len(frame[rows:]) == 0
    assert frame[["room_degC", "time_s"]].columns == ["room_degC", "time_s"]
    assert [row["time_s"] for row in frame] == frame["time_s"] and len(list(frame)) == rows
    assert "room_degC" in frame and "nope" not in frame
    again = pickle.loads(pickle.dumps(frame))
    assert again == frame and again != frame[1:] and athermal.Graph is not None

    shown = repr(frame)
    assert shown.splitlines()[0] == f"<athermal.Frame of {rows} rows and {len(names)} columns, of which 3 are not shown>"
    assert "…" in shown and "plate1_degC" in shown and len(shown.splitlines()) == 13 and max(map(len, shown.splitlines())) < 120
    assert "–" in shown or "–" in frame._repr_html_()
    assert frame._repr_html_().count("<tr>") == 12 and f"{rows} rows" in frame._repr_html_() and "<script" not in frame._repr_html_()
    assert repr(frame[:2]).count("\n") == 3 and repr(frame[:0])

    for wrong, kind in [("rom_degC", KeyError), (rows, IndexError), (-rows - 1, IndexError), (["time_s", "x"], KeyError)]:
        with pytest.raises(athermal.RequestError) as error:
            frame[wrong]
        assert isinstance(error.value, kind) and str(error.value).startswith("there is no ")
    with pytest.raises(TypeError, match="column"):
        frame[1.5]


def test_a_frame_shows_instants_as_dates_and_keeps_their_kind():
    import pickle
    from datetime import timezone

    graph = athermal.Graph(DATED)
    predicted = graph.fit(dated(timezone.utc)).predict(dated(timezone.utc))
    assert "2026-03-02 00:00:30+00:00" in repr(predicted)
    assert pickle.loads(pickle.dumps(predicted))._table.clock("when") == ("ns", "UTC")
    assert predicted["when"][1] - predicted["when"][0] == 30 * 10**9 and not math.isnan(predicted["when"][0])

"""Frames of every library give what a file of the same numbers gives."""

from __future__ import annotations

import csv
import json
import math
from datetime import datetime, timezone
from decimal import Decimal
from pathlib import Path

import pytest

import athermal
from conftest import GRAPH, parts, run


def frames_of(columns):
    """The same table in every library that is installed, by its name."""
    found = {"dict": columns}
    try:
        import pandas

        found["pandas"] = pandas.DataFrame(columns)
    except ImportError:
        pass
    try:
        import polars

        found["polars"] = polars.DataFrame(columns)
        found["lazy"] = polars.DataFrame(columns).lazy()
    except ImportError:
        pass
    try:
        import pyarrow

        found["pyarrow"] = pyarrow.table(columns)
        found["batch"] = pyarrow.record_batch(columns)
    except ImportError:
        pass
    try:
        import duckdb
        import pyarrow

        found["duckdb"] = duckdb.from_arrow(pyarrow.table(columns))
    except ImportError:
        pass
    return found


LIBRARIES = ["dict", "pandas", "polars", "lazy", "pyarrow", "batch", "duckdb"]


@pytest.fixture(params=LIBRARIES)
def library(request):
    return request.param


@pytest.fixture
def frame(library, columns):
    found = frames_of(columns)
    if library not in found:
        pytest.skip(f"{library} is not installed")
    return found[library]


def as_lists(frame):
    """A frame of any library as lists with `None`."""
    if hasattr(frame, "to_dict") and not hasattr(frame, "index"):
        found = frame.to_dict(as_series=False) if hasattr(frame, "with_columns") else frame.to_dict()
    elif hasattr(frame, "index"):
        found = frame.to_dict("list")
    elif hasattr(frame, "to_pydict"):
        found = frame.to_pydict()
    else:
        rows = frame.fetchall()
        found = {name: [row[nth] for row in rows] for nth, name in enumerate(frame.columns)}
    absent = lambda value: None if isinstance(value, float) and math.isnan(value) else value
    return {name: [absent(value) for value in values] for name, values in found.items()}


def test_a_frame_gives_the_model_of_a_file_of_the_same_numbers(frame, graph, files):
    assert parts(graph.fit(frame)) == parts((files / "model.json").read_text())


def test_predictions_are_those_of_run_in_a_frame_of_the_same_library(frame, library, model, files):
    run(files, "run", "model.json", "--input", "week.csv", "--output", "predicted.csv")
    with (files / "predicted.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    expected = {name: [float(row[name]) if row[name] else None for row in rows] for name in rows[0]}
    predicted = model.predict(frame)
    kinds = {"dict": athermal.Frame, "lazy": None}
    assert type(predicted) is kinds.get(library, type(frame)) or library == "lazy"
    assert as_lists(predicted) == expected
    assert any(value is not None for value in expected["predicted.Z1"])


def test_the_path_of_a_file_is_data_too(graph, files):
    assert parts(graph.fit(files / "week.csv")) == parts((files / "model.json").read_text())


def test_the_card_has_no_path_and_knows_rows_by_their_values(graph, columns, files):
    cards = {json.dumps(graph.fit(frame).card["data"]) for frame in frames_of(columns).values()}
    (card,) = cards
    (of,) = json.loads(card)
    assert not of.get("path")
    assert of["rows"] == len(columns["time_s"])


def test_a_list_of_frames_is_one_of_segments(graph, columns, files, tmp_path):
    half = len(columns["time_s"]) // 2
    pieces = [{name: of[:half] for name, of in columns.items()}, {name: of[half:] for name, of in columns.items()}]
    for nth, piece in enumerate(pieces):
        with (tmp_path / f"{nth}.csv").open("w", newline="") as file:
            lines = csv.writer(file)
            lines.writerow(piece)
            lines.writerows(zip(*[["" if value is None else repr(value) for value in of] for of in piece.values()]))
    (tmp_path / "graph.toml").write_text(GRAPH)
    run(tmp_path, "fit", "graph.toml", "--segments", "-o", "model.json", "--data", "0.csv", "1.csv")
    of_list = graph.fit(pieces)
    assert parts(of_list) == parts((tmp_path / "model.json").read_text())
    assert parts(of_list) != parts(graph.fit(columns))
    assert len(of_list.predict(pieces)) == len(columns["time_s"])


def test_another_column_can_stand_for_the_time(frame, graph, columns, library):
    renamed = {("when" if name == "time_s" else name): of for name, of in columns.items()}
    frame = frames_of(renamed)[library]
    model = graph.fit(frame, time="when")
    assert parts(model) == parts(graph.fit(columns))
    assert next(iter(as_lists(model.predict(frame, time="when")))) == "when"


def test_absent_is_nan_and_null(graph, columns):
    pyarrow = pytest.importorskip("pyarrow")
    with_nan = {name: [math.nan if value is None else value for value in of] for name, of in columns.items()}
    assert any(value is None for of in columns.values() for value in of)
    assert parts(graph.fit(pyarrow.table(with_nan))) == parts(graph.fit(pyarrow.table(columns)))


ROWS = 400


def small(**columns):
    """Rows of the small graph, with some columns otherwise."""
    base = {"time_s": [30.0 * nth for nth in range(ROWS)]}
    for phase, name in enumerate(["plate1_degC", "plate2_degC", "room_degC", "Z1_nm", "Z2_nm"]):
        base[name] = [20 + math.sin(nth / (11 + phase)) + math.cos(nth * nth + phase) / 50 for nth in range(ROWS)]
    return {**base, **columns}


def without(columns, name):
    return {key: of for key, of in columns.items() if key != name}


def words_of_file(tmp_path: Path, columns) -> str:
    """What the command line says of the same table as a file, without its name."""
    import subprocess
    import sys

    (tmp_path / "graph.toml").write_text(GRAPH)
    with (tmp_path / "frame").open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(columns)
        lines.writerows(zip(*columns.values()))
    command = [sys.executable, "-m", "athermal", "fit", "graph.toml", "--data", "frame", "-o", "out.json"]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True).stderr


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_missing_column_is_named_with_what_may_be_meant(library, graph, tmp_path):
    columns = small()
    columns["rooms_degC"] = columns.pop("room_degC")
    found = frames_of(columns)
    if library not in found:
        pytest.skip(f"{library} is not installed")
    with pytest.raises(athermal.RequestError) as error:
        graph.fit(found[library])
    # A file has lines besides.
    assert str(error.value).removeprefix("frame") in words_of_file(tmp_path, columns)
    assert "room_degC" in str(error.value) and "rooms_degC" in str(error.value)


@pytest.mark.parametrize("library", LIBRARIES)
def test_times_that_do_not_rise_are_left_out_and_counted(library, graph, model, tmp_path):
    columns = small()
    columns["time_s"][7] = 30.0
    columns["time_s"][9] = columns["time_s"][8]
    found = frames_of(columns)
    if library not in found:
        pytest.skip(f"{library} is not installed")
    with pytest.warns(athermal.AthermalWarning) as caught:
        predicted = model.predict(found[library])
    words = " ".join(str(of.message) for of in caught)
    assert "row whose time is out of order" in words
    assert "row whose time is that of the row before" in words
    lists = as_lists(predicted)
    assert len(lists["time_s"]) == len(columns["time_s"]) - 2


def test_texts_that_are_no_numbers_get_the_words_of_a_file(graph, tmp_path):
    texts = [str(of) for of in small()["room_degC"]]
    texts[5] = "broken"
    columns = small(room_degC=texts)
    (said,) = {
        words
        for frame in frames_of(columns).values()
        for words in [str(pytest.raises(athermal.RequestError, graph.fit, frame).value)]
    }
    assert "`broken`" in said and "room_degC" in said
    with pytest.warns(athermal.AthermalWarning, match="unreadable cell"):
        graph.fit(columns, lenient=True)


def test_numbers_of_other_types_are_numbers(graph):
    plain = small()
    decimals = small(room_degC=[Decimal(str(round(of, 2))) for of in plain["room_degC"]])
    texts = small(room_degC=[str(round(of, 2)) for of in plain["room_degC"]])
    rounded = small(room_degC=[round(of, 2) for of in plain["room_degC"]])
    expected = parts(graph.fit(rounded))
    for columns in [decimals, texts]:
        for name, frame in frames_of(columns).items():
            assert parts(graph.fit(frame)) == expected, name


def test_a_column_of_nothing_is_absent(graph):
    nothing = small(room_degC=[None] * ROWS)
    expected = parts(graph.fit(small(room_degC=[math.nan] * ROWS)))
    for name, frame in frames_of(nothing).items():
        assert parts(graph.fit(frame)) == expected, name


def test_a_categorical_column_is_read_by_its_texts(graph):
    pandas = pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    texts = [f"{20 + 0.1 * (nth % 3):.1f}" for nth in range(ROWS)]
    expected = parts(graph.fit(small(room_degC=[float(of) for of in texts])))
    assert parts(graph.fit(pandas.DataFrame(small()).assign(room_degC=pandas.Categorical(texts)))) == expected
    of_polars = polars.DataFrame(small()).with_columns(room_degC=polars.Series(texts, dtype=polars.Categorical))
    assert parts(graph.fit(of_polars)) == expected


def test_truth_values_are_one_and_zero_as_in_a_file(graph):
    flags = [nth % 2 == 0 for nth in range(ROWS)]
    expected = parts(graph.fit(small(room_degC=[float(of) for of in flags])))
    for name, frame in frames_of(small(room_degC=flags)).items():
        assert parts(graph.fit(frame)) == expected, name


def test_objects_of_several_kinds_are_read_as_a_file_would_have_them(graph):
    pandas = pytest.importorskip("pandas")
    mixed = [20.0 if nth % 2 else f"{20 + nth / 100}" for nth in range(ROWS)]
    expected = parts(graph.fit(small(room_degC=[float(of) for of in mixed])))
    frame = pandas.DataFrame(small())
    frame["room_degC"] = pandas.Series(mixed, dtype=object)
    frame["unread"] = [object() for _ in mixed]
    assert parts(graph.fit(frame)) == expected


@pytest.mark.parametrize("library", LIBRARIES)
def test_an_empty_frame_gets_the_words_of_a_file(library, graph, tmp_path):
    found = frames_of({name: [] for name in small()})
    if library not in found:
        pytest.skip(f"{library} is not installed")
    with pytest.raises(athermal.FitError) as error, pytest.warns():
        import warnings

        warnings.warn("as if there were one")
        graph.fit(found[library])
    assert error.value.reasons
    for reason in error.value.reasons:
        assert reason in words_of_file(tmp_path, {name: [] for name in small()})


def test_what_is_no_frame_is_refused_with_what_is_one(graph):
    for what in [7, object(), [1.0, 2.0], []]:
        with pytest.raises(TypeError, match="frame"):
            graph.fit(what)


DATED = GRAPH.replace('column = "time_s"', 'column = "when"')


def dated(zone=None):
    columns = small()
    start = 1_772_409_600
    columns["when"] = [datetime.fromtimestamp(start + of, timezone.utc).replace(tzinfo=zone) for of in columns.pop("time_s")]
    return columns


def test_dates_without_a_zone_are_of_utc_with_one_warning():
    graph = athermal.Graph(DATED)
    expected = parts(graph.fit(dated(timezone.utc)))
    for name, frame in frames_of(dated()).items():
        with pytest.warns(athermal.AthermalWarning) as caught:
            model = graph.fit(frame)
        zones = [of for of in caught if "zone" in str(of.message)]
        assert len(zones) == 1, name
        assert zones[0].filename == __file__
        assert parts(model) == expected, name


def test_dates_without_a_zone_go_by_that_of_the_graph():
    graph = athermal.Graph(DATED.replace('column = "when"', 'column = "when"\nunit = "rfc3339"\nzone = "+02:00"'))
    utc = athermal.Graph(DATED).fit(dated(timezone.utc)).card["period"]
    for name, frame in frames_of(dated()).items():
        period = graph.fit(frame).card["period"]
        assert period["from_s"] == utc["from_s"] - 7200, name


def test_times_come_back_in_the_type_in_which_they_came():
    pandas = pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    graph = athermal.Graph(DATED)
    columns = dated(timezone.utc)
    model = graph.fit(columns)
    for frame in [polars.DataFrame(columns), polars.DataFrame(columns).with_columns(polars.col("when").dt.cast_time_unit("ms"))]:
        predicted = model.predict(frame)
        assert predicted.schema["when"] == frame.schema["when"]
        assert predicted["when"].to_list() == frame["when"].to_list()
    frame = pandas.DataFrame(columns)
    predicted = model.predict(frame)
    assert predicted["when"].dtype == frame["when"].dtype
    assert predicted["when"].to_list() == frame["when"].to_list()


def test_predictions_of_pandas_go_by_the_labels_of_the_rows(model, columns):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(columns)
    frame.index = [f"row {nth}" for nth in range(len(frame))]
    assert list(model.predict(frame).index) == list(frame.index)

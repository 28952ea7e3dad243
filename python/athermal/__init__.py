"""Predicts and corrects the thermal drift of precision machines.

A graph is fitted on data, which gives a model; a model predicts, is scored, and runs as an engine:

    graph = athermal.Graph("die-tester.toml")
    model = graph.fit(frame)
    predicted = model.predict(other)
    print(athermal.evaluate(model, other))

Data are frames of pandas, polars, pyarrow or DuckDB, anything with `__arrow_c_stream__`, dicts of columns, paths of files, or a list of
these, of which each is a segment of its own. Further named arguments are the options of the command line: `lenient=True` is `--lenient`.
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from athermal import _athermal, _frames, _nodes
from athermal._athermal import Table, __version__
from athermal._errors import (
    AthermalWarning,
    Diagnostic,
    Error,
    FitError,
    GraphError,
    NodeError,
    OutsideError,
    RequestError,
)
from athermal._nodes import Channel, estimator, feature
from athermal._progress import Progress
from athermal._results import (
    Comparison,
    Diagnosis,
    Facts,
    FitReport,
    Report,
    Scores,
    coefficients_html,
)

__all__ = [
    "AthermalWarning",
    "Channel",
    "Comparison",
    "Diagnosis",
    "Diagnostic",
    "Engine",
    "Error",
    "Facts",
    "FitError",
    "FitReport",
    "Frame",
    "Graph",
    "GraphError",
    "Model",
    "NodeError",
    "OutsideError",
    "Report",
    "RequestError",
    "Scores",
    "Starter",
    "__version__",
    "compare",
    "diagnose",
    "estimator",
    "evaluate",
    "feature",
    "init",
    "report",
    "simulate",
]

class Frame:
    """A table of Arrow: for pandas, polars, pyarrow, DuckDB, or whoever else takes `__arrow_c_stream__`."""

    def __init__(self, table: Table) -> None:
        self._table = table

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return self._table.column_names

    def __len__(self) -> int:
        return len(self._table)

    def __getitem__(self, column: str) -> list[Any]:
        return self._table.column(column)

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

    def __repr__(self) -> str:
        return f"<athermal.Frame of {len(self):,} rows: {', '.join(self.columns)}>"


def _like(given: Any, made: Table) -> Any:
    return Frame(made) if _frames.module_of(given) == "athermal" else _wrapped(_frames.like(given, made))


def _wrapped(made: Any) -> Any:
    return Frame(made) if isinstance(made, Table) else made


def _plain(value: Any) -> Any:
    """A graph as JSON takes it: what is `None` is not there, and a node of Python goes by its name."""
    if isinstance(value, Mapping):
        return {str(key): _plain(of) for key, of in value.items() if of is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(of) for of in value]
    return _nodes.reference(value) if _nodes.is_node(value) else value


def _renamed(time: str | None, columns: list[str]) -> dict[str, str] | None:
    if time is None or [time] == columns:
        return None
    if len(columns) != 1:
        raise RequestError(f"time={time!r}: the graph puts its time together from {', '.join(columns)}; give these columns")
    return {time: columns[0]}


def _call(
    graph: _athermal.Graph, data: Any, time: str | None, progress: Progress, options: Mapping[str, Any]
) -> _frames.Call:
    call = _frames.Call(options, progress)
    _frames.add_data(call, data, columns=graph.columns, renamed=_renamed(time, graph.time_columns))
    return call


class Graph:
    """A graph that is to be fitted: the path of a file, the text of one, or a dict of the same."""

    def __init__(self, graph: str | os.PathLike[str] | Mapping[str, Any]) -> None:
        if isinstance(graph, Mapping):
            self._graph = _athermal.Graph.of_json("graph", json.dumps(_plain(graph), allow_nan=False))
        elif isinstance(graph, str) and "\n" in graph:
            self._graph = _athermal.Graph.of_text("graph.toml", graph)
        else:
            self._graph = _athermal.Graph.of_path(os.fspath(graph))

    @property
    def name(self) -> str | None:
        """Its name, where it has one."""
        return self._graph.name

    @property
    def columns(self) -> list[str]:
        """The columns that it reads of data, those of the time first."""
        return self._graph.columns

    @property
    def channels(self) -> list[str]:
        """The measured channels, such as `temperature.room`."""
        return self._graph.channels

    @property
    def outputs(self) -> list[str]:
        """What it puts out, such as `predicted.Z1`."""
        return self._graph.outputs

    @property
    def truths(self) -> dict[str, str]:
        """What is predicted by each output that is a prediction: `drift.Z1` by `predicted.Z1`."""
        return {output: truth for output, _, truth in self._graph.predictions}

    def to_dict(self) -> dict[str, Any]:
        """The graph as declared, with what its file extends."""
        tree: dict[str, Any] = json.loads(self._graph.to_json())
        return tree

    def svg(self) -> str:
        """A drawing, as SVG."""
        return self._graph.svg()

    def fit(self, data: Any, time: str | None = None, *, progress: Progress = None, **options: Any) -> Model:
        """Fits the graph on data, as `athermal fit` does, whose options it takes: `threads`, `memory`, `lenient`, `segments`.

        `time` names the column that stands for the one that the graph declares. Raises `RequestError` where the data are not what the
        graph reads, and `FitError` where nothing can be fitted.
        """
        return Model._of(*self._graph.fit(_call(self._graph, data, time, progress, options)))

    def model(self) -> Model:
        """The model of a graph in which nothing needs a fit, such as one of features alone."""
        return Model._of(self._graph.model())

    def __reduce__(self) -> tuple[Any, ...]:
        return _graph_of, (self._graph.to_json(),)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Graph) and self._graph.to_json() == other._graph.to_json()

    def __hash__(self) -> int:
        return hash(self._graph.to_json())

    def __repr__(self) -> str:
        return f"<athermal.Graph {self.name or ''}: {len(self.channels)} channels, puts out {', '.join(self.outputs)}>"

    def _repr_html_(self) -> str:
        return self.svg()

    @classmethod
    def _of(cls, graph: _athermal.Graph) -> Graph:
        made = cls.__new__(cls)
        made._graph = graph
        return made


def _graph_of(tree: str) -> Graph:
    return Graph._of(_athermal.Graph.of_json("graph", tree))


class Model:
    """A graph with its fits."""

    _model: _athermal.Model
    _text: str | None

    def __init__(self) -> None:
        raise TypeError("a model comes from `Graph.fit`, `Model.load` or `Model.from_json`")

    @classmethod
    def _of(cls, model: _athermal.Model, text: str | None = None) -> Model:
        made = cls.__new__(cls)
        made._model, made._text = model, text
        return made

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Model:
        """Reads a model; or a graph file in which nothing needs a fit, or which names its model."""
        return cls._of(_athermal.Graph.model_of_path(os.fspath(path)))

    @classmethod
    def from_json(cls, text: str) -> Model:
        """The model of a text."""
        return cls._of(_athermal.Model.of_json("model", text))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model, as `athermal fit -o` does."""
        path = Path(path)
        beside = path.with_name(f".{path.name}.new")
        beside.write_text(self.to_json(), encoding="utf-8")
        os.replace(beside, path)

    def to_json(self) -> str:
        """The model as a text, which is the same for the same model."""
        return self._model.to_json()

    @property
    def graph(self) -> Graph:
        """Its graph, without the fits."""
        return Graph._of(self._model.graph())

    @property
    def report(self) -> FitReport:
        """How its fit went."""
        return FitReport(self._text, self._model.card)

    @property
    def card(self) -> dict[str, Any] | None:
        """Where it comes from and how its fit went."""
        return self._model.card

    @property
    def coefficients(self) -> list[dict[str, Any]]:
        """The fitted estimators with their coefficients."""
        return self._model.coefficients

    @property
    def revision(self) -> str | None:
        """The revision, by which a snapshot knows its model."""
        return self._model.revision

    def predict(self, data: Any, time: str | None = None, *, progress: Progress = None, **options: Any) -> Any:
        """What the model puts out for data, as `athermal run` does: the time and a column for each output, null where there is none.

        The answer is a frame of the library that the data came from. It has a row for each row that was taken: one whose time is not
        after the one before is left out, with a warning. The options are `frozen`, `lenient` and `segments`.
        """
        graph = self._model.graph()
        call = _call(graph, data, time, progress, options)
        return _like(data, self._model.predict(call, time or " ".join(graph.time_columns)))

    def engine(self) -> Engine:
        """The model as an engine that takes one instant a call."""
        return Engine(self._model.engine())

    def __reduce__(self) -> tuple[Any, ...]:
        return _model_of, (self.to_json(), self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.revision)

    def __repr__(self) -> str:
        return f"<athermal.Model {self._model.graph().name or ''}, revision {self.revision}>"

    def _repr_html_(self) -> str:
        return self.report._repr_html_() + coefficients_html(self.coefficients) + self.graph.svg()


def _model_of(text: str, words: str | None) -> Model:
    return Model._of(_athermal.Model.of_json("model", text), words)


class Engine:
    """A running model. The same steps give the same bits as `athermal run`."""

    def __init__(self, engine: _athermal.Engine) -> None:
        self._engine = engine
        self._step = engine.step

    def step(self, time: int | datetime, values: dict[str, float | None]) -> dict[str, float | None]:
        """Takes the measurements of one instant and gives what the graph puts out; `None` where there is nothing.

        `time` is an instant in ns by the clock of the data, or a date; one without a zone goes by the `zone` of the graph, else UTC.
        `values` has channels (`temperature.room`) or their columns; what is not there has no new value.
        """
        if type(time) is not int:
            time = self._ns(time)
        return self._step(time, values)

    def _ns(self, time: Any) -> int:
        if isinstance(time, datetime):
            if time.tzinfo is None:
                time = time.replace(tzinfo=_frames.zone_of(self._engine.zone))
            return _frames.ns_of(time)
        if hasattr(time, "__index__"):
            return int(time.__index__())
        raise TypeError(f"time is {time!r}: give whole nanoseconds or a datetime")

    def segment(self) -> None:
        """The next step belongs to another segment: windows, lags and filters start afresh."""
        self._engine.segment()

    def freeze(self, frozen: bool = True) -> None:
        """Freezes what is learned while it runs, or lets it go on."""
        self._engine.freeze(frozen)

    def snapshot(self) -> bytes:
        """All that it knows."""
        return self._engine.snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Goes on from a snapshot of an engine of the same model."""
        self._engine.restore(snapshot)

    @property
    def channels(self) -> list[str]:
        """The measured channels."""
        return self._engine.channels

    @property
    def outputs(self) -> list[str]:
        """What the graph puts out."""
        return self._engine.outputs

    @property
    def last_ns(self) -> int | None:
        """The instant of the last step in ns."""
        return self._engine.last_ns


def evaluate(model: Model, data: Any, time: str | None = None, *, progress: Progress = None, **options: Any) -> Scores:
    """Scores the predictions of a model on data, as `athermal evaluate` does, whose options it takes.

    Among them are `mode`, `steps`, `abs_truth_below`, `each_on_its_own` and `frozen`.
    """
    return Scores(*model._model.evaluate(_call(model._model.graph(), data, time, progress, options)))


def diagnose(model: Model, data: Any, time: str | None = None, *, progress: Progress = None, **options: Any) -> Diagnosis:
    """Shows why a model predicts as well as it does, as `athermal diagnose` does: `of`, `window`, `day`, `no_fit`."""
    return Diagnosis(*model._model.diagnose(_call(model._model.graph(), data, time, progress, options)))


def report(model: Model, data: Any, time: str | None = None, *, progress: Progress = None, **options: Any) -> Report:
    """Shows what a model is worth on data, as a page, as `athermal report` does."""
    return Report(*model._model.report(_call(model._model.graph(), data, time, progress, options)))


def compare(
    graphs: Mapping[str, Graph] | list[Graph] | Graph,
    data: Any,
    on: Any,
    *,
    progress: Progress = None,
    **options: Any,
) -> Comparison:
    """Fits graphs on `data` and scores them `on` others, in one table, as `athermal compare` does, whose options it takes."""
    if isinstance(graphs, Graph):
        graphs = [graphs]
    if not isinstance(graphs, Mapping):
        graphs = {f"graph {nth}": of for nth, of in enumerate(graphs, 1)}
    columns = {column for of in graphs.values() for column in of.columns}
    call = _frames.Call(options, progress)
    _frames.add_data(call, on, name="on", option="on", columns=columns)
    _frames.add_data(call, data, columns=columns)
    return Comparison(*_athermal.compare([(name, of._graph) for name, of in graphs.items()], call))


class Starter(Graph):
    """A graph that was written for data."""

    def __init__(self, text: str, remarks: list[str]) -> None:
        super().__init__(text)
        self.text = text
        """The graph file."""
        self.remarks = remarks
        """What was found and guessed."""


def init(data: Any, **options: Any) -> Starter:
    """A starter graph for data, as `athermal init` writes one; its options are `time`, `time_format` and `drifts`."""
    call = _frames.Call(options)
    _frames.add_data(call, data)
    return Starter(*_athermal.init(call))


def simulate(machine: str, days: float = 7.0, seed: int = 1, *, progress: Progress = None, **options: Any) -> Frame:
    """The recording of a simulated machine, `die-tester` or `linear-axis`, as `athermal simulate` writes it.

    Its options are `truth`, `faults` (a list), `disturb` (a list) and `schedule`. The same arguments give the same numbers everywhere.
    """
    faults = options.pop("faults", None)
    asked = {"machine": machine, "days": days, "seed": seed, "fault": faults, **options}
    return Frame(_athermal.simulate(_frames.Call(asked, progress)))


def __getattr__(name: str) -> Any:
    # What builds on another library is imported once it is asked for.
    if name in ("conformance", "dask", "sklearn", "spark"):
        return importlib.import_module(f"athermal.{name}")
    raise AttributeError(f"module 'athermal' has no attribute {name!r}")

"""Predicts and corrects the thermal drift of precision machines.

A graph is fitted on data, which gives a model; a model predicts, is scored, and runs as an engine:

    graph = athermal.Graph("die-tester.toml")
    model = graph.fit(frame)
    predicted = model.predict(other)
    print(athermal.evaluate(model, other))

Data are frames of pandas, polars, pyarrow or DuckDB, anything with `__arrow_c_stream__`, dicts of columns, paths of files, or a list of
these, of which each is a segment of its own; a generator gives pieces of one recording. Options are those of the command line:
`lenient=True` is `--lenient`.
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

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
from athermal._frame import Frame
from athermal._nodes import Channel, estimator, feature
from athermal._plot import draw
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
    "plot",
    "report",
    "simulate",
]

def _frame(made: Any) -> Any:
    return Frame(made) if isinstance(made, Table) else made


def _plain(value: Any) -> Any:
    """A graph as JSON takes it: what is `None` is not there, and a node of Python goes by its name."""
    if isinstance(value, Mapping):
        return {str(key): _plain(of) for key, of in value.items() if of is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(of) for of in value]
    return _nodes.reference(value) if _nodes.is_node(value) else value


def _call(graph: _athermal.Graph, data: Any, time: str | None, progress: Progress, options: Mapping[str, Any]) -> _frames.Call:
    times = graph.time_columns
    if time is not None and len(times) != 1:
        raise RequestError(f"time={time!r}: the graph puts its time together from {', '.join(times)}; give these columns")
    call = _frames.Call(options, progress)
    _frames.add_data(call, data, columns=graph.columns, time=time, times=times)
    return call


def _given(names: dict[str, Any]) -> dict[str, Any]:
    """The options among the arguments of a function."""
    return {name: of for name, of in names.items() if name not in _NO_OPTIONS}


_NO_OPTIONS = {"self", "graph", "native", "graphs", "model", "data", "on", "time", "progress", "options", "faults", "axes"}


def _native(model: Model) -> _athermal.Model:
    if isinstance(model, Model):
        return model._model
    if isinstance(model, Graph):
        raise RequestError("this is a graph and no model: `graph.fit(data)` gives one, or `graph.model()` where nothing needs a fit")
    raise RequestError(f"{model!r} is no model: `athermal.Model.load(path)` reads one")


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

    def fit(
        self,
        data: Any,
        time: str | None = None,
        *,
        progress: Progress = None,
        # Options of fit, written by `python/options.py`:
        lenient: bool = False,
        segments: bool = False,
        merge: bool = False,
        offset: str | Sequence[str] | None = None,
        from_: str | None = None,
        to: str | None = None,
        blocks: str | None = None,
        keep_blocks: str | os.PathLike[str] | None = None,
        threads: int = 0,
        memory: int = 64,
        candidates: bool = False,
    ) -> Model:
        """Fits the graph on data, as `athermal fit` does.

        `time` names the column that stands for the one that the graph declares. Raises `RequestError` where the data are not what the
        graph reads, and `FitError` where nothing can be fitted.

        Options:
            lenient: Take cells and rows that cannot be read as missing, and count them.
            segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
            merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
            offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose`
                estimates it.
            from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of
                time, such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
            to: Read rows before this time alone.
            blocks: Fit on the sums of UTC days in place of rows (`day`), or of stretches of another length, such as `6h` where there are
                few days. Folds end with them, and windows at the beginning of one know the one before. For estimators that are fitted by
                least squares.
            keep_blocks: Keep the blocks in this folder, of a fleet in a folder inside it for each machine. The next fit reads them, and of
                the data only what is new or changed.
            threads: Threads to work with; 0 takes one for each core. The result does not depend on it.
            memory: Megabytes of rows to keep; beyond, rows are streamed in a second pass.
            candidates: Show what else was tried at each step of a selection, with its score, and all orders that were compared.
        """
        return Model._of(*_call(self._graph, data, time, progress, _given(locals())).run(self._graph.fit))

    def model(self) -> Model:
        """The model of a graph in which nothing needs a fit, such as one of features alone."""
        return Model._of(self._graph.model())

    def __reduce__(self) -> tuple[Any, ...]:
        tree = self._graph.to_json()
        return _graph_of, (tree, _nodes.carried(tree))

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


def _graph_of(tree: str, nodes: _nodes.Carried | None = None) -> Graph:
    _nodes.adopt(nodes)
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

    def predict(
        self,
        data: Any,
        time: str | None = None,
        *,
        progress: Progress = None,
        # Options of predict, written by `python/options.py`:
        lenient: bool = False,
        segments: bool = False,
        merge: bool = False,
        offset: str | Sequence[str] | None = None,
        from_: str | None = None,
        to: str | None = None,
        frozen: bool = False,
    ) -> Any:
        """What the model puts out for data, as `athermal run` does: the time and a column for each output, null where there is none.

        The answer is a frame of the library that the data came from. It has a row for each row that was taken: one whose time is not
        after the one before is left out, with a warning.

        Options:
            lenient: Take cells and rows that cannot be read as missing, and count them.
            segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
            merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
            offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose`
                estimates it.
            from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of
                time, such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
            to: Read rows before this time alone.
            frozen: Let no estimator learn on the way.
        """
        graph = self._model.graph()
        call = _call(graph, data, time, progress, _given(locals()))
        name = time or " ".join(graph.time_columns)
        made = call.run(lambda call: self._model.predict(call, name))
        return Frame(made) if isinstance(call.like, Frame) else _frame(_frames.like(call, made))

    def engine(self) -> Engine:
        """The model as an engine that takes one instant a call. Raises `RequestError` where nodes need a fit."""
        return Engine(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _model_of, (self.to_json(), self._text, _nodes.carried(self._model.graph().to_json()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.revision)

    def __repr__(self) -> str:
        return f"<athermal.Model {self._model.graph().name or ''}, revision {self.revision}>"

    def _repr_html_(self) -> str:
        return self.report._repr_html_() + coefficients_html(self.coefficients) + self.graph.svg()


def _model_of(text: str, words: str | None, nodes: _nodes.Carried | None = None) -> Model:
    _nodes.adopt(nodes)
    return Model._of(_athermal.Model.of_json("model", text), words)


class Engine:
    """A running model. The same steps give the same bits as `athermal run`. It is pickled with its model, as a snapshot."""

    def __init__(self, model: Model) -> None:
        self._model, self._frozen = model, False
        self._engine = _native(model).engine()
        self._step = self._engine.step

    def __reduce__(self) -> tuple[Any, ...]:
        return _engine_of, (self._model, self.snapshot(), self._frozen)

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
        self._frozen = frozen
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


def _engine_of(model: Model, snapshot: bytes, frozen: bool) -> Engine:
    engine = Engine(model)
    engine.restore(snapshot)
    engine.freeze(frozen)
    return engine


def evaluate(
    model: Model,
    data: Any,
    time: str | None = None,
    *,
    progress: Progress = None,
    # Options of evaluate, written by `python/options.py`:
    lenient: bool = False,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
    from_: str | None = None,
    to: str | None = None,
    each_on_its_own: bool = False,
    abs_truth_below: str | None = None,
    frozen: bool = False,
    mode: Literal["one-step", "k-step", "free-run"] | None = None,
    steps: int | None = None,
) -> Scores:
    """Scores the predictions of a model on data, as `athermal evaluate` does.

    Options:
        lenient: Take cells and rows that cannot be read as missing, and count them.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
        from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time,
            such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
        to: Read rows before this time alone.
        each_on_its_own: Score each prediction on all instants of its own.
        abs_truth_below: Only truths whose absolute value is below count, such as "250 nm/min".
        frozen: Let no estimator learn on the way; otherwise, what learns does so after each truth has been predicted. Votes go by recent
            errors in either case.
        mode: From which past truths predictions are made; only what reads or follows past truths differs.
        steps: How many steps ahead `mode="k-step"` predicts.
    """
    native = _native(model)
    return Scores(*_call(native.graph(), data, time, progress, _given(locals())).run(native.evaluate))


def diagnose(
    model: Model,
    data: Any,
    time: str | None = None,
    *,
    progress: Progress = None,
    # Options of diagnose, written by `python/options.py`:
    lenient: bool = False,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
    from_: str | None = None,
    to: str | None = None,
    of: str | Sequence[str] | None = None,
    window: bool = False,
    day: str | None = None,
    no_fit: bool = False,
) -> Diagnosis:
    """Shows why a model predicts as well as it does, as `athermal diagnose` does.

    Options:
        lenient: Take cells and rows that cannot be read as missing, and count them.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
        from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time,
            such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
        to: Read rows before this time alone.
        of: Show these predictions, by node, channel or axis, each with all its regressors; else the first of each truth that the graph puts
            out.
        window: Show the signal to noise of each drift against the window that it is taken over. Noise is the standard error of its slopes,
            in which scatter and curvature within the window both count.
        day: How long a day is, of which each is left out once.
        no_fit: Leave out what needs fits of its own: days left out, how many are needed, and how much clocks differ.
    """
    native = _native(model)
    return Diagnosis(*_call(native.graph(), data, time, progress, _given(locals())).run(native.diagnose))


def report(
    model: Model,
    data: Any,
    time: str | None = None,
    *,
    progress: Progress = None,
    # Options of report, written by `python/options.py`:
    lenient: bool = False,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
    from_: str | None = None,
    to: str | None = None,
) -> Report:
    """Shows what a model is worth on data, as a page, as `athermal report` does.

    Options:
        lenient: Take cells and rows that cannot be read as missing, and count them.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
        from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time,
            such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
        to: Read rows before this time alone.
    """
    native = _native(model)
    return Report(*_call(native.graph(), data, time, progress, _given(locals())).run(native.report))


def plot(
    model: Model,
    data: Any,
    time: str | None = None,
    *,
    of: str | Sequence[str] | None = None,
    axes: Any = None,
    progress: Progress = None,
    # Options of report, written by `python/options.py`:
    lenient: bool = False,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
    from_: str | None = None,
    to: str | None = None,
) -> Any:
    """Draws what was measured and predicted, with intervals where there are any, what is left, and the weights of votes, by matplotlib.

    Gives an array of `Axes`: a column for each truth; the rows are measured and predicted, left, and the weights where anything is
    weighed. Each value is drawn at the time of the truth that it predicts. `of` names truths (`Z1`) or predictions (`vote.Z1`), without
    it all are drawn. `axes` are drawn on where they are given.

    Options:
        lenient: Take cells and rows that cannot be read as missing, and count them.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
        from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time,
            such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
        to: Read rows before this time alone.
    """
    options = {name: value for name, value in _given(locals()).items() if name != "of"}
    found = _call(_native(model).graph(), data, time, progress, options).run(model._model.report)
    return draw(found[1]["course"], of, axes)


def compare(
    graphs: Mapping[str, Graph] | Sequence[Graph] | Graph,
    data: Any,
    on: Any,
    *,
    progress: Progress = None,
    # Options of compare, written by `python/options.py`:
    lenient: bool = False,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
    from_: str | None = None,
    to: str | None = None,
    abs_truth_below: str | None = None,
    frozen: bool = False,
    mode: Literal["one-step", "k-step", "free-run"] | None = None,
    steps: int | None = None,
) -> Comparison:
    """Fits graphs on `data` and scores them `on` others, in one table, as `athermal compare` does.

    Options:
        lenient: Take cells and rows that cannot be read as missing, and count them.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
        from_: Read rows from this time on alone: an instant (`2026-03-01T06:00:00Z`), a date, or what stands in the log's column of time,
            such as seconds. Without an offset from UTC it goes by the `zone` of `[time]`.
        to: Read rows before this time alone.
        abs_truth_below: Only truths whose absolute value is below count, such as "250 nm/min".
        frozen: Let no estimator learn on the way; otherwise, what learns does so after each truth has been predicted. Votes go by recent
            errors in either case.
        mode: From which past truths predictions are made; only what reads or follows past truths differs.
        steps: How many steps ahead `mode="k-step"` predicts.
    """
    options = _given(locals())
    if isinstance(graphs, (Graph, str, os.PathLike)):
        graphs = [graphs]
    if not isinstance(graphs, Mapping):
        graphs = {f"graph {nth}": of for nth, of in enumerate(graphs, 1)}
    for name, of in graphs.items():
        if not isinstance(of, Graph):
            raise RequestError(f"{name} is {of!r}, which is no graph: `athermal.Graph(path)` reads one")
    columns = {column for of in graphs.values() for column in of.columns}
    times = next((of._graph.time_columns for of in graphs.values()), [])
    call = _frames.Call(options, progress)
    _frames.add_data(call, on, name="on", option="on", columns=columns, times=times)
    _frames.add_data(call, data, columns=columns, times=times)
    return Comparison(*call.run(lambda call: _athermal.compare([(name, of._graph) for name, of in graphs.items()], call)))


class Starter(Graph):
    """A graph that was written for data."""

    def __init__(self, text: str, remarks: list[str]) -> None:
        super().__init__(text)
        self.text = text
        """The graph file."""
        self.remarks = remarks
        """What was found and guessed."""


def init(
    data: Any,
    *,
    time: str | None = None,
    # Options of init, written by `python/options.py`:
    time_format: str | None = None,
    drifts: str | Sequence[str] | None = None,
    keep: str | Sequence[str] | None = None,
    applied: str | Sequence[str] | None = None,
    table: str | Sequence[str] | None = None,
    segments: bool = False,
    merge: bool = False,
    offset: str | Sequence[str] | None = None,
) -> Starter:
    """A starter graph for data, as `athermal init` writes one.

    `time` is the column that gives the time, or several in braces: `"{Date} {Time}"`; it may be the index of a frame of pandas.

    Options:
        time_format: How dates and times are written that are not as in RFC 3339, in the letters of strptime.
        drifts: The columns that drift.
        keep: Columns that are inputs although they seem to repeat what drifts, or to count.
        applied: The columns of what a correction applied, beside those that are called so.
        table: How the text is laid out where that is not found, as `[table]` of a graph says it: skip=2 names=1 separator=; decimal=,.
        segments: Take each file as a segment of its own, also where its times go on: windows, lags and filters start afresh with it.
        merge: Merge files of different columns by time although their times are no dates: all of them count from one instant.
        offset: Add this to the times of a file, whose clock is behind by it (negative: ahead): `positions.csv=1.5s`. `diagnose` estimates
            it.
    """
    call = _frames.Call(_given(locals()))
    if time is not None:
        call.set("time", time)
    _frames.add_data(call, data, time=time, times=None)
    return Starter(*call.run(_athermal.init))


def simulate(
    machine: str,
    days: float = 7.0,
    seed: int = 1,
    *,
    progress: Progress = None,
    # Options of simulate, written by `python/options.py`:
    spread: str | None = None,
    machine_seed: int = 1,
    truth: bool = False,
    schedule: str | os.PathLike[str] | None = None,
    compensate: str | os.PathLike[str] | None = None,
    faults: str | Sequence[str] | None = None,
    disturb: str | Sequence[str] | None = None,
    change: str | Sequence[str] | None = None,
) -> Frame:
    """The recording of a simulated machine, `die-tester` or `linear-axis`, as `athermal simulate` writes it.

    The same arguments give the same numbers everywhere.

    Options:
        spread: One machine of a fleet: its parameters lie around those of the design, by so much.
        machine_seed: Which machine of the fleet it is; weather, motions and noise follow `seed`.
        truth: Add the true drift of each axis as a column.
        schedule: Set points over time; the machine has a schedule of its own.
        compensate: Let a fitted graph correct the axes; what they applied is recorded as {axis}_applied_nm.
        faults: A fault of a sensor, or of each of a signal: CHANNEL=KIND[,from=…][,for=…][,size=…].
        disturb: The world changes: `door,from=8h,for=3h,size=3`, `lamp,size=0.6 mK/s` or `loose=SENSOR,size=0.5`.
        change: The machine becomes another for good: `expansion=30%@2d`, `contact` (of joints), `load` (of motors), `season=4 K@2d..9d`.
    """
    call = _frames.Call(_given(locals()) | {"fault": faults}, progress)
    return Frame(call.run(_athermal.simulate))


def __getattr__(name: str) -> Any:
    # What builds on another library is imported once it is asked for.
    if name in ("conformance", "dask", "sklearn", "spark"):
        return importlib.import_module(f"athermal.{name}")
    raise AttributeError(f"module 'athermal' has no attribute {name!r}")

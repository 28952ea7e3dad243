"""A graph with the manners of scikit-learn: for `cross_val_score`, pipelines and searches. scikit-learn need not be installed."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import athermal
from athermal import _frames

try:
    from sklearn.base import BaseEstimator, RegressorMixin

    class _Regressor(RegressorMixin, BaseEstimator):  # type: ignore[misc, unused-ignore]
        pass

except ImportError:

    class _Regressor:  # type: ignore[no-redef]
        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """The parameters of the regressor, by their names."""
            return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

        def set_params(self, **params: Any) -> Any:
            """Gives parameters other values."""
            for name, value in params.items():
                if name not in self.get_params():
                    raise ValueError(f"there is no parameter `{name}`; there are {', '.join(self.get_params())}")
                setattr(self, name, value)
            return self


__all__ = ["GraphRegressor"]


class GraphRegressor(_Regressor):
    """One output of a graph, fitted and predicted from frames.

    `graph` is a graph or what `athermal.Graph` takes. `target` is the output (`predicted.Z1`) or the truth that it predicts
    (`drift.Z1`); without it, it is the only output that predicts one. `time` names the column of the time, and `options` are those
    of a fit, such as `{"lenient": True}`. A frame has the columns that the graph reads; the truth is made of them, so `y` may be
    left out. Where `y` is given, it takes the place of the column `y_column`.
    """

    def __init__(
        self,
        graph: athermal.Graph | str | os.PathLike[str] | Mapping[str, Any],
        target: str | None = None,
        time: str | None = None,
        y_column: str | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        self.graph = graph
        self.target = target
        self.time = time
        self.y_column = y_column
        self.options = options

    def fit(self, X: Any, y: Any = None) -> GraphRegressor:
        """Fits the graph on a frame."""
        graph = self.graph if isinstance(self.graph, athermal.Graph) else athermal.Graph(self.graph)
        self.output_ = _output(graph, self.target)
        self.model_ = graph.fit(self._with(X, y), self.time, **(self.options or {}))
        return self

    def predict(self, X: Any) -> Any:
        """The output at each row, as an array of numpy, or a list where numpy is not installed; NaN where there is none."""
        model = self._fitted()
        table = _frames.table(X, model.graph.columns)
        predicted = model.predict(athermal.Frame(table), self.time)
        if len(predicted) < len(table):
            left_out = len(table) - len(predicted)
            raise athermal.RequestError(f"{left_out} rows have no answer, since their time is not after the one before: sort the frame by time")
        values = [float("nan") if value is None else value for value in predicted[self.output_]]
        try:
            import numpy
        except ImportError:
            return values
        return numpy.array(values)

    def score(self, X: Any, y: Any = None) -> float:
        """R² of the predictions of a frame, each against the truth that was measured later."""
        model = self._fitted()
        names = {prediction for output, prediction, _ in model.graph._graph.predictions if output == self.output_}
        found = [of["r2_mean"] for of in athermal.evaluate(model, self._with(X, y), self.time).scores if of["output"] in names]
        return float("nan") if not found or found[0] is None else float(found[0])

    def _fitted(self) -> athermal.Model:
        model: athermal.Model | None = getattr(self, "model_", None)
        if model is None:
            raise athermal.RequestError("the regressor is not fitted yet: call `fit` first")
        return model

    def _with(self, X: Any, y: Any) -> Any:
        """The frame, with `y` in its column."""
        if y is None:
            return X
        column = self.y_column
        if column is None:
            raise athermal.RequestError("`y` was given: name the column that it stands for by `y_column`, or leave `y` out")
        if isinstance(X, Mapping):
            return {**X, column: list(y)}
        if hasattr(X, "with_columns"):
            return X.with_columns(sys.modules["polars"].Series(column, list(y)))
        if hasattr(X, "assign"):
            return X.assign(**{column: list(y)})
        raise TypeError(f"`y` cannot be put into {type(X).__qualname__}: give a frame of pandas or polars, or a frame that has the column")

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "model_")


def _output(graph: athermal.Graph, target: str | None) -> str:
    """The output that is meant."""
    truths = graph.truths
    if target is None:
        fits: Sequence[str] = list(truths)
    else:
        fits = [target] if target in graph.outputs else [output for output, truth in truths.items() if truth == target]
    if len(fits) == 1:
        return fits[0]
    there = ", ".join(f"{output} (of {truth})" for output, truth in truths.items()) or "none"
    which = "predicts a truth" if target is None else f"is or predicts `{target}`"
    many = "more than one output" if fits else "no output"
    raise athermal.RequestError(f"{many} {which}: let `target` be one of {there}")

"""A graph with the manners of scikit-learn: for `cross_val_score`, pipelines and searches. scikit-learn need not be installed."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

import athermal
from athermal import _frames

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.exceptions import NotFittedError as _NotFitted

    class _Regressor(RegressorMixin, BaseEstimator):  # type: ignore[misc, unused-ignore]
        pass

except ImportError:

    class _NotFitted(ValueError, AttributeError):  # type: ignore[no-redef]
        pass

    class _Regressor:  # type: ignore[no-redef]
        def get_params(self, deep: bool = True) -> dict[str, Any]:
            """The parameters of the regressor, by their names."""
            return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

        def set_params(self, **params: Any) -> Any:
            for name, value in params.items():
                if name not in self.get_params():
                    raise ValueError(f"there is no parameter `{name}`; there are {', '.join(self.get_params())}")
                setattr(self, name, value)
            return self


__all__ = ["GraphRegressor", "NotFittedError", "scorer"]

Declared = Union[athermal.Graph, str, "os.PathLike[str]", Mapping[str, Any]]
"""What `athermal.Graph` takes."""

_FIGURES = {
    "r2": ("r2_mean", 1.0),
    "r2_zero": ("r2_zero", 1.0),
    "neg_root_mean_squared_error": ("rmse", -1.0),
    "neg_mean_squared_error": ("rmse", -1.0),
    "neg_max_error": ("max_abs", -1.0),
}
"""What a score goes by: the figure of `athermal.evaluate`, and whether more of it is better."""


class NotFittedError(athermal.RequestError, _NotFitted):  # type: ignore[misc, unused-ignore]
    """The regressor is not fitted yet. It is scikit-learn's error of that name, too."""


class GraphRegressor(_Regressor):
    """One output of a graph, fitted and predicted from frames.

    `graph` is a graph or what `athermal.Graph` takes, or a function that is given the names of the columns of `X` and gives one. `target`
    is the output (`predicted.Z1`) or the truth that it predicts (`drift.Z1`); without it, it is the only output that predicts one. `time`
    names the column of the time, and `options` are those of a fit, such as `{"lenient": True}`. A frame has the columns that the graph
    reads; the truth is made of them, so `y` may be left out. Where `y` is given, it takes the place of the column `y_column`. `scoring`
    is what `score` gives, by the names of scikit-learn: `r2`, `neg_root_mean_squared_error`, `neg_mean_squared_error`, `neg_max_error`,
    and `r2_zero`, which is against no model.

    `X` may be an array, whose columns are those of the graph in their order without `y_column`; of a function they are called `x0`, `x1`
    and so on, and its rows are a second apart.

    `set_params` also takes a part of the graph or one of the options: `graph__nodes__thermal__ahead="10min"`, `options__lenient=True`.
    """

    def __init__(
        self,
        graph: Declared | Callable[[list[str]], Declared],
        target: str | None = None,
        time: str | None = None,
        y_column: str | None = None,
        options: Mapping[str, Any] | None = None,
        scoring: str = "r2",
    ) -> None:
        self.graph = graph
        self.target = target
        self.time = time
        self.y_column = y_column
        self.options = options
        self.scoring = scoring

    def set_params(self, **params: Any) -> Any:
        """Gives parameters other values, or parts of the graph or of the options."""
        plain = {name: value for name, value in params.items() if "__" not in name}
        super().set_params(**plain)
        for name, value in params.items():
            of, _, path = name.partition("__")
            if of == "options" and path:
                self.options = {**(self.options or {}), path: value}
            elif of == "graph" and path and not callable(self.graph):
                tree = _graph(self.graph).to_dict()
                *folders, last = path.split("__")
                place = tree
                for folder in folders:
                    if not isinstance(place.get(folder), dict):
                        raise ValueError(f"{name}: the graph has no `{folder}` there; there are {', '.join(place)}")
                    place = place[folder]
                place[last] = value
                self.graph = tree
            elif path:
                raise ValueError(f"there is no parameter `{name}`")
        return self

    def fit(self, X: Any, y: Any = None) -> GraphRegressor:
        """Fits the graph on a frame."""
        X, y, names = self._columns_of(X, y, True)
        graph = _graph(self.graph(names) if callable(self.graph) else self.graph)
        self.output_ = _output(graph, self.target)
        self.model_ = graph.fit(self._with(graph, X, y), self.time, **(self.options or {}))
        return self

    def predict(self, X: Any) -> Any:
        """The output at each row, as an array of numpy, or a list where numpy is not installed; NaN where there is none."""
        model = self._fitted()
        X, _, _ = self._columns_of(X, None, False)
        graph = model.graph
        table = _frames.table(self._with(graph, X, None), graph.columns, self.time, graph._graph.time_columns)
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

    def score(self, X: Any, y: Any = None, sample_weight: None = None) -> float:
        """How good the predictions of a frame are by `scoring`, each against the truth that was measured later."""
        if sample_weight is not None:
            raise athermal.RequestError("truths are not weighted: leave `sample_weight` out")
        return self._score_by(self.scoring, X, y)

    def _score_by(self, scoring: str, X: Any, y: Any) -> float:
        if scoring not in _FIGURES:
            raise athermal.RequestError(f"scoring={scoring!r}: there are {', '.join(_FIGURES)}")
        figure, sign = _FIGURES[scoring]
        model = self._fitted()
        X, y, _ = self._columns_of(X, y, False)
        graph = model.graph
        names = {prediction for output, prediction, _ in graph._graph.predictions if output == self.output_}
        scores = athermal.evaluate(model, self._with(graph, X, y), self.time).scores
        found = [of[figure] for of in scores if of["output"] in names]
        if not found or found[0] is None:
            return float("nan")
        return sign * float(found[0]) ** (2 if scoring == "neg_mean_squared_error" else 1)

    def _fitted(self) -> athermal.Model:
        model: athermal.Model | None = getattr(self, "model_", None)
        if model is None:
            raise NotFittedError("the regressor is not fitted yet: call `fit` first")
        return model

    def _columns_of(self, X: Any, y: Any, reset: bool) -> tuple[Any, Any, list[str]]:
        """A frame, which an array is made one of, and the names of its columns."""
        if not _is_array(X):
            if not callable(self.graph):
                return X, y, []
            names = [str(of) for of in getattr(X, "columns", X if isinstance(X, Mapping) else [])]
            if reset and names:
                self.feature_names_in_, self.n_features_in_ = _array(names), len(names)
            elif hasattr(self, "feature_names_in_"):
                _check_names(self, X)
            return X, y, names
        try:
            from sklearn.utils.validation import validate_data
        except ImportError as error:
            raise athermal.RequestError("an array is taken with scikit-learn 1.6 or later: install it, or give a frame") from error
        given = {"X": X} if y is None else {"X": X, "y": y, "y_numeric": True}
        valid = validate_data(self, reset=reset, ensure_all_finite="allow-nan", ensure_min_samples=3 if reset else 1, **given)
        X, y = (valid, None) if y is None else valid
        if callable(self.graph):
            names = [f"x{nth}" for nth in range(X.shape[1])]
        else:
            names = [of for of in _graph(self.graph).columns if of != self.y_column]
            if len(names) != X.shape[1]:
                raise athermal.RequestError(f"the array has {X.shape[1]} columns, and the graph reads {len(names)}: {', '.join(names)}")
        return {name: X[:, nth] for nth, name in enumerate(names)}, y, names

    def _with(self, graph: athermal.Graph, X: Any, y: Any) -> Any:
        """The frame, with `y` in its column. Of a graph that was made for it, it also has the time of rows a second apart, and a column
        without values in place of the truth."""
        column = self.y_column
        if y is not None and column is None:
            raise athermal.RequestError("`y` was given: name the column that it stands for by `y_column`, or leave `y` out")
        added: dict[str, Any] = {} if y is None or column is None else {column: list(y)}
        if callable(self.graph):
            there, rows = set(getattr(X, "columns", X)), len(next(iter(X.values()))) if isinstance(X, Mapping) else len(X)
            times = graph._graph.time_columns
            if len(times) == 1 and times[0] not in there and self.time is None and _frames.index_name(X, None, times) is None:
                added[times[0]] = list(range(rows))
            if column is not None and column not in there and y is None:
                if not hasattr(self, "model_"):
                    raise ValueError("GraphRegressor requires y to be passed, but the target y is None, and no column of X has it")
                added[column] = [None] * rows
        if not added:
            return X
        if isinstance(X, Mapping):
            return {**X, **added}
        if hasattr(X, "with_columns"):
            return X.with_columns(*(sys.modules["polars"].Series(name, of) for name, of in added.items()))
        if hasattr(X, "assign"):
            return X.assign(**added)
        raise TypeError(f"`y` cannot be put into {type(X).__qualname__}: give a frame of pandas or polars, or a frame that has the column")

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "model_")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        # What is not to be left out is the time: rows in any order are no recording.
        tags.target_tags.required = callable(self.graph)
        return tags


class scorer:
    """What `cross_val_score`, `GridSearchCV` and others take as `scoring`: a score of truths that are measured later, which the strings of
    scikit-learn do not know, by the same names."""

    def __init__(self, scoring: str) -> None:
        if scoring not in _FIGURES:
            raise athermal.RequestError(f"scoring={scoring!r}: there are {', '.join(_FIGURES)}")
        self.scoring = scoring

    def __call__(self, estimator: Any, X: Any, y: Any = None) -> float:
        if hasattr(estimator, "steps"):
            X = estimator[:-1].transform(X)
            estimator = estimator[-1]
        found: float = estimator._score_by(self.scoring, X, y)
        return found

    def __repr__(self) -> str:
        return f"scorer({self.scoring!r})"


def _graph(of: Any) -> athermal.Graph:
    return of if isinstance(of, athermal.Graph) else athermal.Graph(of)


def _is_array(X: Any) -> bool:
    """Whether it is an array of numbers, or a list of lists of them, which has no names of columns."""
    if hasattr(type(X), "columns") or isinstance(X, (Mapping, str, os.PathLike)) or hasattr(X, "__arrow_c_stream__"):
        return False
    if isinstance(X, (list, tuple)):
        return not X or isinstance(X[0], (list, tuple, int, float)) or _is_array(X[0])
    return (hasattr(X, "shape") or hasattr(X, "__array__")) and not getattr(getattr(X, "dtype", None), "names", None)


def _array(names: list[str]) -> Any:
    numpy = sys.modules.get("numpy")
    return numpy.array(names, dtype=object) if numpy else names


def _check_names(regressor: Any, X: Any) -> None:
    if "sklearn" in sys.modules:
        sys.modules["sklearn.utils.validation"]._check_feature_names(regressor, X, reset=False)


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

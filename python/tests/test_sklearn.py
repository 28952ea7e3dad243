"""A graph goes where regressors of scikit-learn go."""

from __future__ import annotations

import math

import pytest

import athermal
from athermal.sklearn import GraphRegressor
from conftest import GRAPH


def test_parameters_are_read_and_set_without_scikit_learn_too(graph):
    regressor = GraphRegressor(graph, target="drift.Z1")
    assert regressor.get_params() == {"graph": graph, "target": "drift.Z1", "time": None, "y_column": None, "options": None, "scoring": "r2"}
    assert regressor.set_params(target="predicted.Z2") is regressor
    assert regressor.target == "predicted.Z2"
    with pytest.raises(ValueError, match="nonsense"):
        regressor.set_params(nonsense=1)


def test_it_predicts_and_scores_as_the_model_does(graph, model, week):
    regressor = GraphRegressor(graph, target="drift.Z1").fit(week)
    predicted = [None if math.isnan(value) else value for value in regressor.predict(week)]
    assert predicted == model.predict(week)["predicted.Z1"]
    r2 = [of["r2_mean"] for of in athermal.evaluate(model, week).scores if of["truth"] == "drift.Z1"]
    assert [regressor.score(week)] == r2


def test_a_target_that_is_not_clear_is_refused_with_those_there_are(graph, week):
    for target, words in [(None, "more than one output"), ("drift.Z3", "no output")]:
        with pytest.raises(athermal.RequestError, match=words) as error:
            GraphRegressor(graph, target=target).fit(week)
        assert "predicted.Z1 (of drift.Z1)" in str(error.value)
    with pytest.raises(athermal.RequestError, match="not fitted"):
        GraphRegressor(graph, target="drift.Z1").predict(week)


def test_rows_out_of_order_are_refused_in_a_prediction(graph, week):
    regressor = GraphRegressor(graph, target="drift.Z1").fit(week)
    columns = week.to_dict()
    columns["time_s"][5] = 0.0
    with pytest.warns(athermal.AthermalWarning), pytest.raises(athermal.RequestError, match="sort the frame"):
        regressor.predict(columns)


def test_it_is_cloned_cross_validated_searched_and_put_into_pipelines(week):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("sklearn")
    from sklearn.base import clone, is_regressor
    from sklearn.model_selection import GridSearchCV, TimeSeriesSplit, cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    frame = athermal.simulate("die-tester", days=1).to_pandas()
    regressor = GraphRegressor(GRAPH, target="drift.Z1")
    again = clone(regressor)
    assert again.get_params() == regressor.get_params() and is_regressor(again)
    folds = TimeSeriesSplit(3)
    scores = cross_val_score(regressor, frame, cv=folds)
    parts = list(folds.split(frame))
    by_hand = [again.fit(frame.iloc[fit]).score(frame.iloc[held]) for fit, held in parts]
    assert list(scores) == by_hand and all(math.isfinite(score) for score in scores)

    cleaned = make_pipeline(FunctionTransformer(lambda of: of.assign(room_degC=of["room_degC"].clip(10, 30))), regressor)
    assert list(cross_val_score(cleaned, frame, cv=folds)) == pytest.approx(list(scores))
    assert isinstance(cleaned.fit(frame).predict(frame[:100]), type(frame["time_s"].to_numpy()))

    slower = GRAPH.replace('windows = ["5min", "12min"]', 'windows = ["12min"]')
    search = GridSearchCV(regressor, {"graph": [GRAPH, slower]}, cv=folds).fit(frame)
    assert search.best_params_["graph"] in (GRAPH, slower) and len(search.cv_results_["mean_test_score"]) == 2
    assert pandas.notna(search.best_score_)


def test_y_takes_the_place_of_a_column(graph, week):
    pandas = pytest.importorskip("pandas")
    frame = week.to_pandas()
    without, y = frame.drop(columns="Z1_nm"), frame["Z1_nm"]
    with_y = GraphRegressor(graph, target="drift.Z1", y_column="Z1_nm").fit(without, y)
    assert with_y.model_.report.scores == GraphRegressor(graph, target="drift.Z1").fit(frame).model_.report.scores
    assert with_y.score(without, y) == with_y.score(frame)
    with pytest.raises(athermal.RequestError, match="y_column"):
        GraphRegressor(graph, target="drift.Z1").fit(without, y)
    assert isinstance(frame, pandas.DataFrame)


def straight(columns):
    """A straight line through the columns of an array, of which each row stands for itself."""
    unit = {"unit": "1", "column": "{channel}", "max_age": "1s"}
    return {
        "schema": 1,
        "time": {"column": "row", "unit": "s"},
        "signals": {"x": {"channels": list(columns), **unit}, "y": {"channels": ["y"], **unit}},
        "nodes": {"straight": {"type": "linear", "inputs": {"features": "x", "truth": "y.y"}, "ahead": "0s"}},
        "outputs": {"predicted": "straight"},
    }


def sluggish(columns):
    """The same of what a body of some seconds makes of the columns: what a row is worth depends on those before it."""
    tree = straight(columns)
    tree["nodes"]["body"] = {"type": "first_order", "inputs": {"signal": "x"}, "time_constants": ["3s"]}
    tree["nodes"]["straight"]["inputs"]["features"] = "body"
    return tree


ROWS_IN_ANY_ORDER = "rows are a recording in the order of time: what is predicted of one depends on those before it"
# What no graph with a memory can pass, and why.
NOT_PASSED = {
    "check_methods_sample_order_invariance": ROWS_IN_ANY_ORDER,
    "check_methods_subset_invariance": ROWS_IN_ANY_ORDER,
}


@pytest.mark.parametrize(("graph", "not_passed"), [(straight, {}), (sluggish, NOT_PASSED)], ids=["straight", "sluggish"])
def test_it_passes_the_checks_of_scikit_learn(graph, not_passed):
    pytest.importorskip("sklearn", minversion="1.6")
    import warnings

    from sklearn.utils.estimator_checks import check_estimator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = check_estimator(GraphRegressor(graph, y_column="y"), expected_failed_checks=not_passed, on_fail="raise")
    status = {of["check_name"]: of["status"] for of in found}
    assert {name for name, of in status.items() if of == "xfail"} == set(not_passed)
    assert sum(of == "passed" for of in status.values()) > 40


def test_scikit_learn_scores_truths_that_are_measured_later_and_searches_parts_of_a_graph(graph):
    pytest.importorskip("pandas")
    pytest.importorskip("sklearn")
    from sklearn.model_selection import GridSearchCV, TimeSeriesSplit, cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    from athermal.sklearn import scorer

    frame = athermal.simulate("die-tester", days=0.5).to_pandas()
    regressor = GraphRegressor(graph, target="drift.Z1", scoring="neg_root_mean_squared_error")
    folds = TimeSeriesSplit(2)
    errors = cross_val_score(regressor, frame, cv=folds)
    assert all(of < 0 for of in errors)
    assert list(cross_val_score(regressor, frame, cv=folds, scoring=scorer("neg_root_mean_squared_error"))) == list(errors)
    piped = make_pipeline(FunctionTransformer(), regressor)
    assert list(cross_val_score(piped, frame, cv=folds, scoring=scorer("r2"))) == list(cross_val_score(regressor.set_params(scoring="r2"), frame, cv=folds))
    search = GridSearchCV(regressor, {"graph__nodes__thermal__ahead": ["5min", "6min"], "options__threads": [1]}, cv=folds).fit(frame)
    assert search.best_estimator_.model_.graph.to_dict()["nodes"]["thermal"]["ahead"] == search.best_params_["graph__nodes__thermal__ahead"]


def test_parts_of_the_graph_and_of_the_options_are_parameters(graph):
    regressor = GraphRegressor(graph).set_params(graph__nodes__thermal__ahead="6min", options__lenient=True)
    assert regressor.graph["nodes"]["thermal"]["ahead"] == "6min" and regressor.options == {"lenient": True}
    assert graph.to_dict()["nodes"]["thermal"]["ahead"] == "5min"
    for wrong in ({"graph__nods__thermal": 1}, {"target__of": 1}, {"nonsense": 1}):
        with pytest.raises(ValueError):
            regressor.set_params(**wrong)
    with pytest.raises(athermal.RequestError, match="neg_root_mean_squared_error"):
        GraphRegressor(graph, target="drift.Z1", scoring="rmse").fit(athermal.simulate("die-tester", days=0.2)).score({})


def test_what_is_not_fitted_is_so_for_scikit_learn_too(graph, week):
    from athermal.sklearn import NotFittedError

    with pytest.raises(NotFittedError, match="call `fit` first") as error:
        GraphRegressor(graph, target="drift.Z1").predict(week)
    assert isinstance(error.value, (ValueError, AttributeError)) and isinstance(error.value, athermal.RequestError)
    try:
        from sklearn.exceptions import NotFittedError as theirs
    except ImportError:
        return
    assert isinstance(error.value, theirs)


def test_an_array_has_the_columns_of_the_graph_in_their_order(graph, week):
    numpy = pytest.importorskip("numpy")
    pytest.importorskip("sklearn")
    of_frame = GraphRegressor(graph, target="drift.Z1").fit(week).predict(week)
    array = numpy.array([week[name] for name in graph.columns], dtype=float).T
    assert numpy.array_equal(GraphRegressor(graph, target="drift.Z1").fit(array).predict(array), of_frame, equal_nan=True)
    with pytest.raises(athermal.RequestError, match="the array has 2 columns, and the graph reads 6: time_s"):
        GraphRegressor(graph, target="drift.Z1").fit(array[:, :2])


def test_the_index_of_a_frame_is_the_time_here_too(graph, week):
    pytest.importorskip("pandas")
    frame = week.to_pandas()
    expected = GraphRegressor(graph, target="drift.Z1").fit(frame).predict(frame)
    indexed = frame.set_index("time_s")
    assert str(list(GraphRegressor(graph, target="drift.Z1").fit(indexed).predict(indexed))) == str(list(expected))


def test_a_lazy_frame_of_polars_is_taken_without_a_warning(graph, week):
    polars = pytest.importorskip("polars")
    import warnings

    lazy = week.to_polars().lazy()
    with warnings.catch_warnings():
        warnings.simplefilter("error", polars.exceptions.PerformanceWarning)
        predicted = GraphRegressor(graph, target="drift.Z1").fit(lazy).predict(lazy)
    assert len(predicted) == len(week)

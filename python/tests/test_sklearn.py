"""A graph goes where regressors of scikit-learn go."""

from __future__ import annotations

import math

import pytest

import athermal
from athermal.sklearn import GraphRegressor
from conftest import GRAPH


def test_parameters_are_read_and_set_without_scikit_learn_too(graph):
    regressor = GraphRegressor(graph, target="drift.Z1")
    assert regressor.get_params() == {"graph": graph, "target": "drift.Z1", "time": None, "y_column": None, "options": None}
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

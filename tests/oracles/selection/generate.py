"""What scikit-learn, mlxtend and statsmodels select on one table. Writes input.csv and expected.json beside itself.

Twelve columns of four sensors, three each. Column 0 is nearly the sum of columns 4 and 8, so that a forward search takes it first
and a floating one gives it back. Needs numpy, scikit-learn, mlxtend, statsmodels.
"""

import json
from pathlib import Path

import numpy as np
import statsmodels.api as sm
from mlxtend.feature_selection import SequentialFeatureSelector as Mlxtend
from sklearn.feature_selection import SequentialFeatureSelector as Sklearn
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import KFold, TimeSeriesSplit, cross_val_score

HERE = Path(__file__).parent
ROWS, SENSORS, EACH = 400, 4, 3
COLUMNS = SENSORS * EACH
random = np.random.default_rng(1)
X = np.cumsum(random.standard_normal((ROWS, COLUMNS)), 0) * 0.02 + random.standard_normal((ROWS, COLUMNS))
X[:, 0] = X[:, 4] + X[:, 8] + 0.35 * random.standard_normal(ROWS)
X[:, 5] = 0.8 * X[:, 3] + 0.5 * random.standard_normal(ROWS)
y = 1.5 * X[:, 4] + 1.4 * X[:, 8] + 0.6 * X[:, 2] - 0.4 * X[:, 5] + 0.2 * X[:, 9] + random.standard_normal(ROWS)
X, y = X.round(5), y.round(5)
np.savetxt(HERE / "input.csv", np.column_stack([X, y]), delimiter=",", fmt="%.5f", comments="",
           header=",".join([f"x{i}" for i in range(COLUMNS)] + ["y"]))


def contiguous():
    return list(KFold(5, shuffle=False).split(X))


def blocked(folds, gap, embargo):
    every = np.arange(ROWS)
    return [(every[(every < test[0] - gap) | (every > test[-1] + gap + embargo)], test)
            for _, test in KFold(folds, shuffle=False).split(X)]


def expanding(folds, gap):
    return list(TimeSeriesSplit(folds, gap=gap).split(X))


def folds_of(model, columns, splits):
    if not columns:
        return [1 - np.sum((y[t] - y[f].mean()) ** 2) / np.sum((y[t] - y[t].mean()) ** 2) for f, t in splits]
    return cross_val_score(model, X[:, columns], y, cv=splits, scoring="r2")


def step(model, splits, change, candidate, scores):
    folds = scores[candidate]
    return {"candidate": candidate, "change": change, "mean": float(np.mean(folds)), "folds": list(map(float, folds)),
            "candidates": {str(c): float(np.mean(s)) for c, s in scores.items()}}


def forward(model, splits, groups):
    """Greedy to the end, `groups` being lists of columns."""
    there, steps = [], []
    while len(there) < len(groups):
        scores = {g: folds_of(model, [c for h in there + [g] for c in groups[h]], splits)
                  for g in range(len(groups)) if g not in there}
        best = max(scores, key=lambda g: np.mean(scores[g]))
        steps.append(step(model, splits, "added", best, scores))
        there.append(best)
    return steps


def backward(model, splits):
    there, steps = list(range(COLUMNS)), []
    while len(there) > 1:
        scores = {c: folds_of(model, [d for d in there if d != c], splits) for c in there}
        best = max(scores, key=lambda c: np.mean(scores[c]))
        steps.append(step(model, splits, "removed", best, scores))
        there.remove(best)
        for_sklearn = Sklearn(model, n_features_to_select=len(there), direction="backward", cv=splits, scoring="r2")
        assert sorted(there) == np.flatnonzero(for_sklearn.fit(X, y).support_).tolist()
    return steps


def floating(model, splits, most):
    """Pudil, Novovicova and Kittler 1994, with records per size."""
    there, steps, record = [], [], {}
    while len(there) < most:
        scores = {c: folds_of(model, there + [c], splits) for c in range(COLUMNS) if c not in there}
        new = max(scores, key=lambda c: np.mean(scores[c]))
        steps.append(step(model, splits, "added", new, scores))
        there.append(new)
        record[len(there)] = max(record.get(len(there), -np.inf), np.mean(scores[new]))
        while len(there) > 2:
            scores = {c: folds_of(model, [d for d in there if d != c], splits) for c in there if c != new}
            worst = max(scores, key=lambda c: np.mean(scores[c]))
            if np.mean(scores[worst]) <= record[len(there) - 1]:
                break
            record[len(there) - 1] = np.mean(scores[worst])
            steps.append(step(model, splits, "removed", worst, scores))
            there.remove(worst)
    reference = Mlxtend(model, k_features=most, forward=True, floating=True, scoring="r2", cv=splits).fit(X, y)
    # mlxtend goes back only where that beats the larger set too, so it may miss a record on the way.
    for size, score in record.items():
        assert score >= reference.subsets_[size]["avg_score"] - 1e-12, (size, score)
    assert sorted(there) == sorted(reference.k_feature_idx_)
    return steps


def stepwise(enter, remove):
    """Efroymson 1960 by statsmodels' F tests of nested models."""
    def model(columns):
        return sm.OLS(y, sm.add_constant(X[:, columns]) if columns else np.ones((ROWS, 1))).fit()

    there, steps = [], []
    while True:
        scores = {c: float(model(there + [c]).compare_f_test(model(there))[0]) for c in range(COLUMNS) if c not in there}
        best = max(scores, key=scores.get) if scores else None
        if best is None or scores[best] < enter:
            return steps
        there.append(best)
        steps.append({"candidate": best, "change": "added", "f": scores[best], "r2": float(model(there).rsquared),
                      "candidates": {str(c): s for c, s in scores.items()}})
        while True:
            full = model(there)
            scores = {c: float(full.compare_f_test(model([d for d in there if d != c]))[0]) for c in there if c != best}
            worst = min(scores, key=scores.get) if scores else None
            if worst is None or scores[worst] >= remove:
                break
            there.remove(worst)
            steps.append({"candidate": worst, "change": "removed", "f": scores[worst],
                          "r2": float(model(there).rsquared), "candidates": {str(c): s for c, s in scores.items()}})


ols, ridge = LinearRegression(), Ridge(5.0, solver="cholesky")
columns = [[c] for c in range(COLUMNS)]
sensors = [list(range(s * EACH, (s + 1) * EACH)) for s in range(SENSORS)]
parsimonious = Mlxtend(ols, k_features="parsimonious", forward=True, floating=False, scoring="r2", cv=contiguous()).fit(X, y)
assert sorted(Mlxtend(ridge, k_features=2, scoring="r2", cv=contiguous(), feature_groups=sensors).fit(X, y).k_feature_idx_) == sorted(
    c for s in forward(ridge, contiguous(), sensors)[:2] for c in sensors[s["candidate"]])
expected = {
    "backward_ols": backward(ols, contiguous()),
    "backward_ridge_5": backward(ridge, contiguous()),
    "floating_ols": floating(ols, contiguous(), 7),
    "forward_ridge_5_by_sensor": forward(ridge, contiguous(), sensors),
    "forward_ols_blocked_4_gap_6_embargo_10": forward(ols, blocked(4, 6, 10), columns),
    "forward_ols_expanding_4_gap_7": forward(ols, expanding(4, 7), columns),
    "forward_ols": forward(ols, contiguous(), columns),
    "parsimonious": {"columns": sorted(map(int, parsimonious.k_feature_idx_)), "of": "forward_ols"},
    "stepwise": stepwise(4.0, 3.9),
}
(HERE / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")

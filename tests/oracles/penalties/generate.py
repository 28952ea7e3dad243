"""Ridge, lasso and elastic net by scikit-learn on ../selection/input.csv, standardised over all rows, for lasso and elastic
net the target too. Writes expected.json beside itself.

Generalised cross-validation is computed from its definition with numpy's SVD (Golub, Heath and Wahba 1979); the penalty that
scikit-learn's RidgeCV chooses by its folds must be the best of the scores that are written.
"""

import json
from pathlib import Path

import numpy as np
from sklearn.linear_model import ElasticNet, Lasso, Ridge, RidgeCV
from sklearn.model_selection import KFold, cross_val_score

HERE = Path(__file__).parent
table = np.loadtxt(HERE / "../selection/input.csv", delimiter=",", skiprows=1)
raw, y = table[:, :-1], table[:, -1]
deviation = raw.std(0)
X = (raw - raw.mean(0)) / deviation
n = len(y)
size = y.std()
target = (y - y.mean()) / size
splits = list(KFold(5, shuffle=False).split(X))


def gcv(alpha):
    u, s, _ = np.linalg.svd(X - X.mean(0), full_matrices=False)
    centred = y - y.mean()
    shrink = s**2 / (s**2 + alpha)
    fitted = u @ (shrink * (u.T @ centred))
    return float(n * np.sum((centred - fitted) ** 2) / (n - 1 - shrink.sum()) ** 2)


def folds(model, of=y):
    return list(map(float, cross_val_score(model, X, of, cv=splits, scoring="r2")))


alphas = [10.0**k for k in np.arange(-2, 4.01, 0.5)]
penalties = [{"alpha": float(a), "gcv": gcv(a), "folds": folds(Ridge(a, solver="svd"))} for a in alphas]
best = max(penalties, key=lambda p: np.mean(p["folds"]))["alpha"]
assert RidgeCV(alphas, cv=splits, scoring="r2").fit(X, y).alpha_ == best

tight = dict(tol=1e-14, max_iter=1_000_000)
models = []
for alpha, ratio in [(0.01, 1.0), (0.1, 1.0), (0.5, 1.0), (0.1, 0.5), (0.02, 0.1)]:
    model = ElasticNet(alpha=alpha, l1_ratio=ratio, **tight).fit(X, target)
    if ratio == 1.0:
        assert np.allclose(model.coef_, Lasso(alpha=alpha, **tight).fit(X, target).coef_, atol=1e-10)
    coef = model.coef_ * size / deviation
    models.append({"alpha": alpha, "l1_ratio": ratio, "coef": list(map(float, coef)),
                   "intercept": float(y.mean() - coef @ raw.mean(0)), "zeros": int(np.sum(model.coef_ == 0))})

expected = {
    "penalties": penalties,
    "ridge_cv": {"by_folds": best, "by_gcv": min(penalties, key=lambda p: p["gcv"])["alpha"]},
    "elastic_net": models,
    "largest_alpha": float(np.max(np.abs(X.T @ target)) / n),
    "lasso_folds": [{"alpha": float(a), "folds": folds(Lasso(alpha=a, **tight), target)} for a in np.logspace(-3, 0, 10)],
}
(HERE / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")

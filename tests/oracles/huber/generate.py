"""Huber regression by scikit-learn on ../selection/input.csv with outliers in the target. Writes target.csv and expected.json.

scikit-learn descends by L-BFGS and stops some 1e-5 before the minimum; scipy's root finder takes the gradient of the same
objective to zero from there.
"""

import json
from pathlib import Path

import numpy as np
from scipy.optimize import root
from sklearn.linear_model import HuberRegressor

HERE = Path(__file__).parent
table = np.loadtxt(HERE / "../selection/input.csv", delimiter=",", skiprows=1)
raw, y = table[:, :-1], table[:, -1].copy()
random = np.random.default_rng(3)
hit = random.choice(len(y), 40, replace=False)
y[hit] = (y[hit] + random.standard_normal(40) * 30 + 15).round(5)
np.savetxt(HERE / "target.csv", y[:, None], fmt="%.5f", header="y", comments="")
deviation = raw.std(0)
X = (raw - raw.mean(0)) / deviation


def gradient(at, epsilon, alpha):
    w, b, scale = at[:-2], at[-2], at[-1]
    r = y - X @ w - b
    inside = np.abs(r) <= epsilon * scale
    pull = np.where(inside, r / scale, epsilon * np.sign(r))
    by_scale = len(y) - np.sum(r[inside] ** 2) / scale**2 - np.sum(~inside) * epsilon**2
    return np.r_[-2 * X.T @ pull + 2 * alpha * w, -2 * pull.sum(), by_scale]


def objective(at, epsilon, alpha):
    w, b, scale = at[:-2], at[-2], at[-1]
    r = np.abs(y - X @ w - b)
    inside = r <= epsilon * scale
    lines = np.sum(2 * epsilon * r[~inside] - epsilon**2 * scale)
    return float(len(y) * scale + np.sum(r[inside] ** 2) / scale + lines + alpha * w @ w)


models = []
for epsilon, alpha in [(1.35, 1e-4), (1.1, 0.0), (2.0, 50.0)]:
    model = HuberRegressor(epsilon=epsilon, alpha=alpha, tol=1e-10, max_iter=100_000).fit(X, y)
    near = np.r_[model.coef_, model.intercept_, model.scale_]
    found = root(gradient, near, args=(epsilon, alpha), tol=1e-13)
    assert np.abs(found.x - near).max() < 1e-3 and np.abs(found.fun).max() < 1e-9, found
    coef = found.x[:-2] / deviation
    models.append({"epsilon": epsilon, "alpha": alpha, "coef": list(map(float, coef)),
                   "intercept": float(found.x[-2] - coef @ raw.mean(0)), "scale": float(found.x[-1]),
                   "outliers": int(model.outliers_.sum()), "objective": objective(found.x, epsilon, alpha)})
(HERE / "expected.json").write_text(json.dumps(models, indent=1) + "\n")

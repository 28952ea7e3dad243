"""Stepwise regression of second order with statsmodels and scikit-learn's PolynomialFeatures on four columns of
../selection/input.csv. Writes target.csv and expected.json beside itself.
"""

import json
from pathlib import Path

import numpy as np
import statsmodels.api as sm
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

HERE = Path(__file__).parent
names = ["x2", "x4", "x8", "x9"]
table = np.genfromtxt(HERE / "../selection/input.csv", delimiter=",", names=True)
X = np.column_stack([table[name] for name in names])
random = np.random.default_rng(5)
y = (1.2 * X[:, 0] - X[:, 1] + 0.5 * X[:, 1] ** 2 + 0.6 * X[:, 2] * X[:, 3] - 0.3 * X[:, 0] * X[:, 1]
     + 0.5 * random.standard_normal(len(X))).round(5)
np.savetxt(HERE / "target.csv", y[:, None], fmt="%.5f", header="y", comments="")
expansion = PolynomialFeatures(2, include_bias=False)
Z = expansion.fit_transform(StandardScaler().fit_transform(X))
terms = list(expansion.get_feature_names_out(names))


def model(columns):
    return sm.OLS(y, sm.add_constant(Z[:, columns]) if columns else np.ones((len(y), 1))).fit()


there = []
while True:
    scores = {c: float(model(there + [c]).compare_f_test(model(there))[0]) for c in range(len(terms)) if c not in there}
    best = max(scores, key=scores.get)
    if scores[best] < 4.0:
        break
    there.append(best)
    while True:
        full = model(there)
        scores = {c: float(full.compare_f_test(model([d for d in there if d != c]))[0]) for c in there if c != best}
        worst = min(scores, key=scores.get) if scores else None
        if worst is None or scores[worst] >= 3.9:
            break
        there.remove(worst)
fit = model(there)
expected = {"terms": [terms[c] for c in there], "r2": float(fit.rsquared),
            "predictions": list(map(float, fit.predict()[:60]))}
(HERE / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")

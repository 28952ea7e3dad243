"""Structural models by statsmodels: exact diffuse start, regressors, missing observations, irregular times, most likely variances.

python 3.11, numpy 2.3, statsmodels 0.15. Run it in this folder; it is seeded and writes series.csv, filtered.csv and
scalars.json. `step` is the time since the row before (1 for the regular models), an empty `y` is a missing observation.
"""
import json

import numpy as np
from statsmodels.tsa.statespace.mlemodel import MLEModel
from statsmodels.tsa.statespace.structural import UnobservedComponents

r = np.random.default_rng(11)
n = 160
x = np.column_stack([np.sin(np.arange(n) / 9.0), r.standard_normal(n)])
level, trend, ys = 5.0, 0.02, []
step = np.round(r.uniform(0.2, 3.0, n), 3)
for i in range(n):
    ys.append(level + x[i] @ [2.0, -0.7] + 0.3 * r.standard_normal())
    level += trend + 0.1 * r.standard_normal()
    trend += 0.01 * r.standard_normal()
y = np.array(ys)
y[[0, 7, 8, 9, 40, 90, 91, 159]] = np.nan

REGULAR = [0.09, 0.01, 0.0001]  # variances of observation, level and trend


def regular(kind):
    model = UnobservedComponents(y, kind, exog=x, mle_regression=False, use_exact_diffuse=True)
    model.ssm.tolerance = 0
    return model


def irregular():
    """Continuous time (Harvey 1989, section 9.2): the matrices change from row to row."""
    model = MLEModel(y, k_states=4, k_posdef=2, initialization="diffuse", loglikelihood_burn=0)
    model.ssm.tolerance = 0
    model["obs_cov"] = np.array([[REGULAR[0]]])
    model["design"] = np.stack([np.array([[1.0, 0.0, *x[i]]]) for i in range(n)], axis=2)
    ahead = np.append(step[1:], 1.0)  # statsmodels goes from row i to row i + 1 with the matrices of row i
    move = np.repeat(np.eye(4)[:, :, None], n, axis=2)
    move[0, 1, :] = ahead
    model["transition"] = move
    model["selection"] = np.eye(4)[:, :2]
    noise = np.zeros((2, 2, n))
    noise[0, 0] = REGULAR[1] * ahead + REGULAR[2] * ahead**3 / 3
    noise[0, 1] = noise[1, 0] = REGULAR[2] * ahead**2 / 2
    noise[1, 1] = REGULAR[2] * ahead
    model["state_cov"] = noise
    return model.ssm.filter()


trended = regular("local linear trend")
filtered = trended.filter(REGULAR)
uneven = irregular()
# statsmodels has level and trend first, then the coefficients.
columns = ["row"]
for name in ("regular", "irregular"):
    columns += [f"{name}_{s}" for s in ("level", "trend", "b1", "b2", "var_level", "cov_level_b1", "var_b2")]
with open("filtered.csv", "w") as out:
    print(",".join(columns), file=out)
    for i in range(20, n):
        cells = [i]
        for res in (filtered, uneven):
            a, p = res.filtered_state[:, i], res.filtered_state_cov[:, :, i]
            cells += [*a, p[0, 0], p[0, 2], p[3, 3]]
        print(",".join(repr(float(c)) if j else str(c) for j, c in enumerate(cells)), file=out)
with open("series.csv", "w") as out:
    print("step,x1,x2,y", file=out)
    for i in range(n):
        print(",".join([repr(float(step[i])), *(repr(float(v)) for v in x[i]), "" if np.isnan(y[i]) else repr(float(y[i]))]), file=out)


def best(model):
    """The best of several starts and optimisers."""
    fits = []
    for start in ([0.1, 0.01, 0.0001], [0.05, 0.1, 0.001], [0.2, 0.001, 0.01]):
        for method in ("lbfgs", "nm"):
            k = len(model.param_names)
            fits.append(model.fit(start[:k], method=method, maxiter=4000, disp=0))
    fit = max(fits, key=lambda f: f.llf)
    return {"llf": float(fit.llf), "params": [float(v) for v in fit.params]}


ahead = filtered.get_forecast(3, exog=np.array([[0.5, 0.1], [0.4, 0.0], [0.3, -1.0]]))
json.dump(
    {
        "variances": REGULAR,
        "regular_llf": float(filtered.llf),
        "irregular_llf": float(np.sum(uneven.llf_obs)),
        "forecast_x": [[0.5, 0.1], [0.4, 0.0], [0.3, -1.0]],
        "forecast_mean": [float(v) for v in ahead.predicted_mean],
        "forecast_deviation": [float(v) for v in ahead.se_mean],
        "most_likely_trend": best(trended),
        "most_likely_level": best(regular("local level")),
    },
    open("scalars.json", "w"),
    indent=1,
)

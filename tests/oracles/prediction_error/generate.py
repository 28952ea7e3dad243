"""Models identified by the prediction error: ARMA, ARIMA and ARIMAX by statsmodels, ARMAX, OE and BJ by sippy_unipi, all by scipy.

python 3.11, numpy 2.3, scipy 1.17, statsmodels 0.15, sippy_unipi 1.0. Run it in this folder; it is seeded and writes samples.csv
and expected.json. statsmodels maximises the exact likelihood, with the variance of each coefficient; sippy_unipi and scipy
minimise the sum of squared one-step errors that lfilter gives, scipy from the true model on and to 1e-12.
"""
import json

import numpy as np
import pandas as pd
import sippy_unipi
from scipy.optimize import least_squares, minimize_scalar
from scipy.optimize._numdiff import approx_derivative
from scipy.signal import lfilter, lfiltic
from statsmodels.tsa.arima.model import ARIMA

r = np.random.default_rng(21)
n = 1500
u = lfilter([1.0], [1.0, -0.6], np.sign(r.standard_normal(n)) * r.uniform(0.5, 1.5, n))
e = 0.4 * r.standard_normal(n)
TRUE = {  # a, b, f, c, d without their leading 1; b begins one sample back
    "arma": dict(a=[-1.5, 0.7], b=[], f=[], c=[0.5], d=[], level=2.0),
    "armax": dict(a=[-1.2, 0.5], b=[0.8, -0.3], f=[], c=[-0.6], d=[], level=2.0),
    "oe": dict(a=[], b=[0.5, 0.3], f=[-1.3, 0.6], c=[], d=[], level=2.0),
    "bj": dict(a=[], b=[0.7, 0.2], f=[-0.8], c=[0.5], d=[-0.9], level=2.0),
    "arima": dict(a=[-0.6], b=[], f=[], c=[0.4], d=[], level=0.0),
    "arimax": dict(a=[-0.7], b=[0.5, 0.2], f=[], c=[-0.4], d=[], level=0.0),
}


def p(polynomial):
    return np.r_[1.0, polynomial]


def simulate(a, b, f, c, d, level, integrated):
    w = lfilter(np.r_[0.0, b], p(f), u) if b else np.zeros(n)
    noise = lfilter(p(c), p(d), e)
    if integrated:
        noise = np.cumsum(noise)
    return lfilter([1.0], p(a), w + noise) + level


samples = pd.DataFrame({"u": u})
for name, model in TRUE.items():
    samples[name] = simulate(**model, integrated=name.startswith("arima"))
samples = samples.round(9)
samples.to_csv("samples.csv", index=False)
u = samples["u"].to_numpy()
expected = {}


def by_scipy(name):
    """The first samples are taken as given, as long as the model reaches back; before them, noise and errors are 0. What the
    filter of the input gave before is found with the coefficients."""
    model, y = TRUE[name], samples[name].to_numpy()
    sizes = [len(model[key]) for key in "abfcd"]
    integrated = name.startswith("arima")

    def errors(theta):
        theta, before = np.split(theta, [len(theta) - len(model["f"])])
        level, theta = (0.0, theta) if integrated else (theta[0], theta[1:])
        a, b, f, c, d = np.split(theta, np.cumsum(sizes)[:-1])
        w = np.zeros(n)
        if len(b):
            w = lfilter(np.r_[0.0, b], p(f), u, zi=lfiltic(np.r_[0.0, b], p(f), before, np.zeros(len(b))))[0]
        first = max(len(a), len(b))
        left = lfilter(p(a), [1.0], y - level) - w
        whitening = np.convolve(p(d), [1.0, -1.0]) if integrated else p(d)
        # Filters of the noise begin with what is known of it.
        white = np.convolve(left[first:], whitening)[len(whitening) - 1 : n - first]
        return lfilter([1.0], p(c), white)

    coefficients = np.r_[[] if integrated else model["level"], *[model[key] for key in "abfcd"]].astype(float)
    found = least_squares(errors, np.r_[coefficients, np.zeros(len(model["f"]))], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    rows, count = len(errors(found.x)), len(coefficients)
    jacobian = approx_derivative(errors, found.x, method="3-point")
    covariance = 2 * found.cost / (rows - len(found.x)) * np.linalg.inv(jacobian.T @ jacobian)
    return {"coefficients": found.x[:count].tolist(), "errors": np.sqrt(np.diag(covariance))[:count].tolist(),
            "sum_of_squares": 2 * found.cost, "rows": rows}


def by_statsmodels(name, order):
    y = samples[name].to_numpy()
    trend = "n" if order[1] else "c"
    model = ARIMA(y, order=order, trend=trend).fit(method_kwargs={"maxiter": 500})
    values = dict(zip(model.model.param_names, model.params))
    errors = dict(zip(model.model.param_names, model.bse))
    sign = lambda key: -1.0 if key.startswith("ar.") else 1.0
    keys = [key for key in values if key != "sigma2"]
    return {
        "coefficients": [sign(key) * values[key] for key in keys],
        "errors": [errors[key] for key in keys],
        "variance": values["sigma2"],
    }


def arimax_by_statsmodels():
    """On the differences it is ARMAX, for each `a` a regression with an error that is a moving average; `a` is the likeliest."""
    dy, du = np.diff(samples["arimax"]), np.diff(u)
    inputs = np.c_[du[1:-1], du[:-2]]

    def model(a):
        return ARIMA(dy[2:] + a * dy[1:-1], exog=inputs, order=(0, 0, 1), trend="n").fit()

    a = minimize_scalar(lambda a: -model(a).llf, bounds=(-0.9, -0.5), method="bounded", options={"xatol": 1e-8}).x
    found = model(a)
    *rest, variance = found.params
    h = 1e-3  # the curvature of the likelihood of `a`, all others being the likeliest beside it
    curvature = (2 * found.llf - model(a - h).llf - model(a + h).llf) / h**2
    errors = [curvature**-0.5, *found.bse[:-1]]
    return {"coefficients": [a, *rest], "errors": list(map(float, errors)), "variance": float(variance)}


def by_sippy(name, kind, **orders):
    y = samples[name].to_numpy() - samples[name].mean()
    model = sippy_unipi.system_identification(y.reshape(1, -1), (u - u.mean()).reshape(1, -1), kind, **orders)
    g, h = model.G, model.H
    return {"G": [np.ravel(g.num[0][0]).tolist(), np.ravel(g.den[0][0]).tolist()],
            "H": [np.ravel(h.num[0][0]).tolist(), np.ravel(h.den[0][0]).tolist()],
            "variance": float(np.ravel(model.Vn)[0])}


for name in TRUE:
    expected[name] = {"scipy": by_scipy(name)}
expected["arma"]["statsmodels"] = by_statsmodels("arma", (2, 0, 1))
expected["arima"]["statsmodels"] = by_statsmodels("arima", (1, 1, 1))
expected["arimax"]["statsmodels"] = arimax_by_statsmodels()
SIPPY = [("armax", "ARMAX", dict(ARMAX_orders=[2, 2, 1, 0], ARMAX_mod="ILLS", max_iterations=400)),
         ("oe", "OE", dict(OE_orders=[2, 2, 0])),
         ("bj", "BJ", dict(BJ_orders=[2, 1, 1, 1, 0]))]
for name, kind, orders in SIPPY:
    expected[name]["sippy"] = by_sippy(name, kind, **orders)
with open("expected.json", "w") as file:
    json.dump(expected, file, indent=1)

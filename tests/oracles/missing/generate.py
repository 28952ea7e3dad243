"""One-step predictions and their deviations where samples are missing: the Kalman filter of statsmodels.

python 3.11, numpy 2.4, scipy 1.17, statsmodels 0.15. Run it in this folder; it is seeded and writes models.json (the models as the
project writes them, with the variance of an innovation) and one CSV for each: the input, the sample (empty where it is missing),
what was predicted of it and the standard deviation.

A(q)(y − μ) = B/F u + C/(D (1 − q⁻¹)^d) e is a regression on B/(F A) u with coefficient 1 and errors
ARIMA(na + nd, d, nc) (Ljung 1999, eq. 4.33). The filters of statsmodels begin at a stationary or diffuse past, so that
predictions are to be compared where the start is forgotten.
"""
import json

import numpy as np
from scipy.signal import lfilter
from statsmodels.tsa.statespace.sarimax import SARIMAX

r = np.random.default_rng(33)
n, complete = 500, 60
u = lfilter([1.0], [1.0, -0.6], r.standard_normal(n))
e = 0.4 * r.standard_normal(n)
MODELS = {  # a, b, f, c, d without their leading 1; b begins `delay` samples back
    "arma": dict(a=[-1.5, 0.7], delay=0, b=[], f=[], c=[0.5], d=[], differences=0, level=2.0),
    "armax": dict(a=[-1.5, 0.7], delay=1, b=[0.8, -0.3], f=[], c=[0.6, -0.2, 0.1], d=[], differences=0, level=2.0),
    "bj": dict(a=[], delay=1, b=[0.7, 0.2], f=[-0.8], c=[0.5], d=[-1.2, 0.5], differences=0, level=-1.0),
    "arimax": dict(a=[-0.7], delay=0, b=[0.5], f=[], c=[-0.4, 0.2], d=[], differences=1, level=0.0),
    "integrated_twice": dict(a=[-0.5], delay=0, b=[0.5], f=[], c=[-0.9, 0.3], d=[], differences=2, level=0.0),
    "all": dict(a=[-0.6, 0.2], delay=2, b=[0.5], f=[-0.5], c=[0.4], d=[-0.7], differences=1, level=0.0),
}


def p(polynomial):
    return np.r_[1.0, polynomial]


def missing():
    """Single samples, and runs of up to fifteen."""
    gone = r.uniform(size=n) < 0.1
    at = complete
    while at < n:
        length = int(r.integers(2, 16))
        gone[at : at + length] = True
        at += length + int(r.integers(5, 40))
    gone[:complete] = False
    return gone


written = {}
for name, m in MODELS.items():
    brought = np.zeros(n)
    if m["b"]:
        brought = lfilter(np.r_[np.zeros(m["delay"]), m["b"]], np.polymul(p(m["f"]), p(m["a"])), u)
    ar = np.polymul(p(m["a"]), p(m["d"]))
    noise = lfilter(p(m["c"]), ar, e)
    for _ in range(m["differences"]):
        noise = np.cumsum(noise)
    y = m["level"] + brought + noise
    y[missing()] = np.nan
    exog = np.column_stack([brought] + [np.ones(n)] * (m["differences"] == 0))
    model = SARIMAX(
        y,
        exog=exog,
        order=(len(ar) - 1, m["differences"], len(m["c"])),
        enforce_stationarity=False,
        enforce_invertibility=False,
    )
    regression = [1.0] + [m["level"]] * (m["differences"] == 0)
    found = model.filter(np.r_[regression, -ar[1:], m["c"], 0.16]).filter_results
    predicted, deviation = found.forecasts[0], np.sqrt(found.forecasts_error_cov[0, 0])
    with open(f"{name}.csv", "w") as out:
        print("u,y,predicted,deviation", file=out)
        for row in zip(u, y, predicted, deviation):
            print(",".join("" if np.isnan(v) else repr(float(v)) for v in row), file=out)
    inputs = [dict(delay=m["delay"], b=m["b"], f=m["f"])] if m["b"] else []
    polynomials = dict(a=m["a"], inputs=inputs, c=m["c"], d=m["d"], differences=m["differences"], level=m["level"])
    written[name] = dict(model=polynomials, variance=0.16)

with open("models.json", "w") as out:
    json.dump(written, out, indent=1)
    print(file=out)

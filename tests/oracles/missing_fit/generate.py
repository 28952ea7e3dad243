"""Models identified where truths are missing: the exact likelihood of statsmodels' Kalman filter, maximised by scipy.

python 3.11, numpy 2.4, scipy 1.17, statsmodels 0.15. Run it in this folder; it is seeded and writes samples.csv (the inputs, and
for each model what they lead to, empty where it is missing) and expected.json: the coefficients, the standard deviation of an
innovation, and standard errors from the curvature of the likelihood.

A(q)(y − μ) = Σ B_i/F_i u_i + C/(D (1 − q⁻¹)^d) e is a regression on Σ B_i/(F_i A) u_i with coefficient 1 and errors
ARIMA(na + nd, d, nc) (Ljung 1999, eq. 4.33). The filters of inputs begin as if these had always been what they are first.
statsmodels' errors begin at a stationary or diffuse past, so that coefficients are to be compared in their standard errors.
"""
import json

import numpy as np
from scipy.optimize import minimize
from scipy.optimize._numdiff import approx_derivative
from scipy.signal import lfilter, lfiltic
from statsmodels.tsa.statespace.sarimax import SARIMAX

r = np.random.default_rng(55)
n = 1000
u = [lfilter([1.0], [1.0, -0.7], r.standard_normal(n)) for _ in range(2)]
e = r.standard_normal(n)
MODELS = {  # a, b and f of each input, c, d without their leading 1; b begins `delay` samples back
    "oe": dict(a=[], b=[[1.0], [0.6]], f=[[-0.5], [-0.8]], delay=0, c=[], d=[], differences=0, level=2.0, noise=0.5),
    "bj": dict(a=[], b=[[0.7]], f=[[-0.8]], delay=1, c=[0.5], d=[-0.7], differences=0, level=2.0, noise=0.4),
    "arma": dict(a=[-1.4, 0.6], b=[], f=[], delay=0, c=[0.5], d=[], differences=0, level=2.0, noise=0.4),
    "armax": dict(a=[-1.4, 0.6], b=[[0.8]], f=[[]], delay=1, c=[0.5], d=[], differences=0, level=2.0, noise=0.4),
    "arimax": dict(a=[-0.7], b=[[0.5]], f=[[]], delay=0, c=[-0.4], d=[], differences=1, level=0.0, noise=0.4),
}


def p(polynomial):
    return np.r_[1.0, polynomial]


def through(b, f, delay, x):
    """As if x had always been what it is first."""
    b, f = np.r_[np.zeros(delay), b], p(f)
    rest = x[0] * b.sum() / f.sum()
    before = lfiltic(b, f, np.full(len(f), rest), np.full(len(b), x[0]))
    return lfilter(b, f, x, zi=before)[0]


def pack(m):
    level = [] if m["differences"] else [m["level"]]
    return np.concatenate([level, m["a"], *[np.r_[b, f] for b, f in zip(m["b"], m["f"])], m["c"], m["d"], [m["noise"]]])


def unpack(theta, of):
    theta, own = list(theta), dict(of)
    take = lambda like: [theta.pop(0) for _ in like]
    own["level"] = 0.0 if of["differences"] else theta.pop(0)
    own["a"] = take(of["a"])
    inputs = [(take(b), take(f)) for b, f in zip(of["b"], of["f"])]
    own["b"], own["f"] = [b for b, _ in inputs], [f for _, f in inputs]
    own["c"], own["d"] = take(of["c"]), take(of["d"])
    own["noise"] = theta.pop(0)
    return own


def brought(m):
    return sum((through(b, np.polymul(p(f), p(m["a"]))[1:], m["delay"], x) for b, f, x in zip(m["b"], m["f"], u)), np.zeros(n))


def likelihood(m, y):
    ar = np.polymul(p(m["a"]), p(m["d"]))
    model = SARIMAX(
        y - m["level"] - brought(m),
        order=(len(ar) - 1, m["differences"], len(m["c"])),
        enforce_stationarity=False,
        enforce_invertibility=False,
        use_exact_diffuse=True,
    )
    return model.loglike(np.r_[-ar[1:], m["c"], m["noise"] ** 2])


columns, expected = list(u), {}
for name, m in MODELS.items():
    noise = lfilter(p(m["c"]), np.polymul(p(m["a"]), p(m["d"])), m["noise"] * e)
    for _ in range(m["differences"]):
        noise = np.cumsum(noise)
    y = (m["level"] + brought(m) + noise).round(9)
    gone = r.uniform(size=n) < 0.2
    for start in (200, 460, 700):
        gone[start : start + 12] = True
    gone[:3], gone[-1] = False, False
    y[gone] = np.nan
    columns.append(y)
    cost = lambda theta: -likelihood(unpack(theta, m), y)
    found = pack(m)
    for _ in range(3):
        found = minimize(cost, found, method="Nelder-Mead", options=dict(maxiter=4000, xatol=1e-7, fatol=1e-9)).x
    slope = lambda theta: approx_derivative(cost, theta, method="3-point", rel_step=1e-4)
    curvature = approx_derivative(slope, found, method="3-point", rel_step=1e-3)
    errors = np.sqrt(np.diag(np.linalg.inv((curvature + curvature.T) / 2)))
    # Without the level, which errors that hardly return to it do not tell, and the noise.
    first = 0 if m["differences"] else 1
    expected[name] = dict(coefficients=found[first:-1].tolist(), errors=errors[first:-1].tolist(), deviation=float(found[-1]))
    print(name, expected[name])

with open("samples.csv", "w") as out:
    print("u1,u2," + ",".join(MODELS), file=out)
    for row in np.column_stack(columns):
        print(",".join("" if np.isnan(v) else repr(float(v)) for v in row), file=out)
with open("expected.json", "w") as out:
    json.dump(expected, out, indent=1)
    print(file=out)

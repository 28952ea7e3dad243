"""The same work by this project and by scikit-learn, numpy, numba, river and statsmodels: the same rows, one run, in turn, one thread.

    pip install -r benches/peers/requirements.txt
    cargo build --profile bench --example peers
    python benches/peers/peers.py target/release/examples/peers

Checks that both sides find the same, and writes the table of README.md beside this file."""

import os

for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ[threads] = "1"

import json
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numba
import numpy as np
from river.linear_model import BayesianLinearRegression
from sklearn.feature_selection import SequentialFeatureSelector
from sklearn.linear_model import LinearRegression, Ridge, RidgeCV
from sklearn.model_selection import KFold
from statsmodels.tsa.statespace.structural import UnobservedComponents

ROUNDS = 5
HERE = Path(__file__).parent
OURS = sys.argv[1]


def candidates(rows, width, seed):
    """Regressors that hang together in pairs, and a target of which a third of them know something."""
    random = np.random.default_rng(seed)
    x = random.uniform(-0.5, 0.5, (rows, width))
    for i in range(1, width):
        x[:, i] += 0.7 * x[:, i - 1]
    known = x[:, ::3]
    y = known @ (1 / np.arange(1, known.shape[1] + 1)) + random.uniform(-0.5, 0.5, rows)
    return x, y


def standardised(x):
    return (x - x.mean(0)) / x.std(0)


def forward(x, y):
    selector = SequentialFeatureSelector(
        Ridge(alpha=1.0), n_features_to_select="auto", tol=1e-3, direction="forward", cv=KFold(3)
    )
    return np.flatnonzero(selector.fit(standardised(x), y).get_support())


def penalty(x, y):
    model = RidgeCV(alphas=np.logspace(-3, 6, 37), cv=KFold(3), scoring="r2").fit(standardised(x), y)
    return np.r_[model.alpha_, model.coef_ / x.std(0)]


def least_squares(x, y):
    return LinearRegression().fit(x, y).coef_


def normal_equations(x, y):
    x_mean, y_mean = x.mean(0), y.mean()
    gram = x.T @ x - len(x) * np.outer(x_mean, x_mean)
    return np.linalg.solve(gram, x.T @ y - len(x) * x_mean * y_mean)


def recursion(x, y):
    width = x.shape[1]
    coefficients, covariance, forgetting = np.zeros(width), np.eye(width), 0.999
    for row, target in zip(x, y):
        projected = covariance @ row
        gain = projected / (forgetting + row @ projected)
        coefficients = coefficients + gain * (target - row @ coefficients)
        covariance = (covariance - np.outer(gain, projected)) / forgetting
    return coefficients


def bayesian(x, y):
    """The nearest that river has: Bayesian regression with a smoothing of its own, so that its coefficients are not compared."""
    model = BayesianLinearRegression(smoothing=0.999)
    names = [f"x{i}" for i in range(x.shape[1])]
    rows = [dict(zip(names, row)) for row in x.tolist()]
    start = time.perf_counter()
    for row, target in zip(rows, y.tolist()):
        model.learn_one(row, target)
    return time.perf_counter() - start


def trend(x, y):
    model = UnobservedComponents(y, "lltrend")
    start = time.perf_counter()
    result = model.filter([1.0, 0.01, 1e-4])
    return time.perf_counter() - start, result.filtered_state[:, -1]


WINDOWS_S = np.array([30, 60, 120, 240, 480, 600, 900, 1200])


@numba.njit
def all_slopes(x, windows_s):
    """By running sums, for a regular clock and no gaps; channels lie side by side, so that they are summed as vectors."""
    count, channels = windows_s.size, x.shape[1]
    total, aged, slopes = np.zeros((count, channels)), np.zeros((count, channels)), np.zeros((count, channels))
    scatter = windows_s * (windows_s**2 - 1) / 12
    of_total, of_aged = (windows_s - 1) / 2 / scatter, 1 / scatter
    for t in range(x.shape[0]):
        for w in range(count):
            n = windows_s[w]
            if t < n:
                for c in range(channels):
                    aged[w, c] += total[w, c]
                    total[w, c] += x[t, c]
                continue
            for c in range(channels):
                old = x[t - n, c]
                aged[w, c] += total[w, c] - n * old
                total[w, c] += x[t, c] - old
                slopes[w, c] = of_total[w] * total[w, c] - of_aged[w] * aged[w, c]
    return slopes


def slopes(x, y):
    return all_slopes(x, WINDOWS_S).T.ravel()


def alike(tolerance):
    return lambda ours, theirs: np.allclose(ours, theirs, rtol=tolerance, atol=tolerance)


def same_set(ours, theirs):
    return sorted(int(i) for i in ours) == list(theirs)


# Work, task of `ours`, rows, regressors, then each peer with what it is to agree in; none where it does another thing.
WORK = [
    ("forward selection, 64 candidates, 3 folds, 8,000 rows", "forward_selection", 8_000, 64, [("scikit-learn", forward, same_set)]),
    ("ridge, penalty of 37 by 3 folds, 8,000 × 64", "ridge_penalty", 8_000, 64, [("scikit-learn RidgeCV", penalty, alike(1e-6))]),
    (
        "least squares, 603,458 × 64",
        "least_squares",
        603_458,
        64,
        [("numpy normal equations", normal_equations, alike(1e-8)), ("scikit-learn", least_squares, alike(1e-8))],
    ),
    (
        "recursive least squares, 16 regressors, 5,000 rows",
        "recursive_least_squares",
        5_000,
        16,
        [("numpy", recursion, alike(1e-6)), ("river, Bayesian regression", bayesian, None)],
    ),
    ("slopes of 8 channels over 8 windows, 604,800 rows", "slopes", 604_800, 8, [("numba", slopes, alike(1e-6))]),
    ("Kalman filter, local linear trend, 20,000 rows", "local_linear_trend", 20_000, 0, [("statsmodels", trend, alike(1e-6))]),
]


def ours(task, file, width):
    told = json.loads(subprocess.run([OURS, task, file, str(width)], check=True, capture_output=True).stdout)
    return told["seconds"], np.array(told["found"])


def theirs(work, x, y):
    start = time.perf_counter()
    found = work(x, y)
    seconds = time.perf_counter() - start
    # What prepares its rows as no user of it would times itself.
    if isinstance(found, tuple):
        return found
    return (found, None) if isinstance(found, float) else (seconds, found)


def text(seconds):
    for limit, factor, unit in [(1e-3, 1e6, "µs"), (1.0, 1e3, "ms")]:
        if seconds < limit:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds:.3g} s"


lines = []
with tempfile.TemporaryDirectory() as folder:
    for name, task, rows, width, peers in WORK:
        x, y = candidates(rows, width, 1) if width else (np.zeros((rows, 0)), np.cumsum(np.random.default_rng(2).standard_normal(rows)))
        file = str(Path(folder) / "rows.bin")
        np.column_stack([x, y]).astype("<f8").tofile(file)
        own, times = [], [[] for _ in peers]
        for _ in range(ROUNDS):
            seconds, found = ours(task, file, width)
            own.append(seconds)
            for (peer, work, agrees), timed in zip(peers, times):
                seconds, answer = theirs(work, x, y)
                timed.append(seconds)
                if agrees is not None and not agrees(found, answer):
                    sys.exit(f"{name}: {found} and {answer} of {peer} differ")
        for (peer, _, _), timed in zip(peers, times):
            mine, other = min(own), min(timed)
            lines.append(f"| {name} | {text(mine)} | {peer} | {text(other)} | {mine / other:.2g} |")
            print(lines[-1], flush=True)

packages = ", ".join(f"{package} {version(package)}" for package in ["numpy", "numba", "scikit-learn", "river", "statsmodels"])
(HERE / "README.md").write_text(
    "# Against peers\n\n"
    "The same work on the same rows in one run, the two sides in turn, one thread each; the best of "
    f"{ROUNDS} rounds, reading the rows not counted. `peers.py` makes this page and checks that both sides find the same.\n\n"
    f"Python {platform.python_version()}, {packages}; {platform.machine()}, {os.cpu_count()} cores.\n\n"
    "| work | here | peer | there | ratio |\n|---|---|---|---|---|\n" + "\n".join(lines) + "\n\n"
    "Selection, penalty and least squares here begin with rows in memory, and least squares keeps none of them, as there. river has no recursive least squares; its Bayesian\n"
    "regression does much the same arithmetic with another smoothing and on a dictionary for each row. numba's slopes are for a regular clock without\n"
    "gaps, and of running sums, whose rounding stays for good; the kernel here takes any times, and subtracts nothing from a sum.\n"
)

"""A machine of a fleet fitted by this project and by pandas and scikit-learn: the same rows of Parquet to the same kind of model.

    pip install -r benches/fleet/requirements.txt
    cargo build --release --features parquet
    for seed in 1 2; do
        athermal simulate die-tester --days 7 --seed $seed -o logs/machine=$seed/log.parquet
    done
    python benches/fleet/peers.py target/release/athermal graphs/die-tester.toml logs

Each side has one thread. Both slopes and selection are those of `graphs/die-tester.toml`: 42 gradients of six temperatures, drift over 5 minutes,
and for each of six axes a ridge on features, one on past drift and one on both. The errors on the rows of the fit are printed beside each other, to show that it is the same work."""

import os

for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ[threads] = "1"

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.feature_selection import SequentialFeatureSelector
from sklearn.linear_model import Ridge
from sklearn.model_selection import KFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

AXES = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"]
SENSORS = ["plate1", "holder1", "plate2", "holder2", "room", "chuck"]
WINDOWS_S = [150.0, 212.933, 302.27, 429.089, 737.707, 1041.267, 1343.223]


def slopes(series, window_s):
    """The slope of the line through the samples of a window, per minute, by running sums."""
    series = series.dropna()
    t = pd.Series((series.index - series.index[0]).total_seconds(), index=series.index)
    y = series - series.iloc[0]
    sums = pd.DataFrame({"n": 1.0, "t": t, "y": y, "tt": t * t, "ty": t * y}, index=series.index)
    sums = sums.rolling(pd.Timedelta(seconds=window_s)).sum()
    slope = (sums.n * sums.ty - sums.t * sums.y) / (sums.n * sums.tt - sums.t**2)
    slope[t < window_s] = np.nan
    return 60.0 * slope


def at(features, times):
    """The last row at or before each time."""
    places = features.index.searchsorted(times, side="right") - 1
    return features.iloc[np.maximum(places, 0)].to_numpy() * np.where(places < 0, np.nan, 1.0)[:, None]


def error(x, y, below, selects):
    kept = np.isfinite(x).all(1) & np.isfinite(y) & (np.abs(y) < below)
    x, y = x[kept], y[kept]
    if selects:
        scaled = StandardScaler().fit_transform(x)
        chosen = SequentialFeatureSelector(Ridge(alpha=1.0), n_features_to_select="auto", tol=1e-3, cv=KFold(3))
        x = x[:, chosen.fit(scaled, y).get_support()]
    model = make_pipeline(StandardScaler(), Ridge(alpha=1.0)).fit(x, y)
    return float(np.sqrt(np.mean((model.predict(x) - y) ** 2)))


def theirs(files):
    frame = pd.concat(pd.read_parquet(file) for file in files)
    frame.index = pd.to_timedelta(frame.pop("time_s"), unit="s")
    gradients = pd.DataFrame(
        {(sensor, window): 1000.0 * slopes(frame[f"{sensor}_degC"], window) for sensor in SENSORS for window in WINDOWS_S}
    ).ffill(limit=10)
    found = {}
    for axis in AXES:
        drift = slopes(frame[f"{axis}_nm"], 300.0).dropna()
        ahead = drift.index - pd.Timedelta(minutes=5)
        features, past = at(gradients, ahead), [at(drift.to_frame(), ahead - pd.Timedelta(minutes=lag)) for lag in (0, 5, 10)]
        past, y = np.hstack(past), drift.to_numpy()
        found[f"thermal.{axis}"] = error(features, y, 150.0, True)
        found[f"motion.{axis}"] = error(past, y, 850.0, False)
        found[f"both.{axis}"] = error(np.hstack([features, past]), y, 850.0, True)
    return found


def ours(program, graph, files):
    with tempfile.TemporaryDirectory() as folder:
        model = str(Path(folder) / "model.json")
        words = [program, "fit", graph, "--threads", "1", "--quiet", "-o", model, "--data", *map(str, files)]
        subprocess.run(words, check=True, capture_output=True)
        card = json.loads(Path(model).read_text())["card"]
    return {of["node"]: of["in_sample_rmse"] for of in card["estimators"]}


program, graph, logs = sys.argv[1:]
for machine in sorted(Path(logs).glob("machine=*"))[:2]:
    files = sorted(machine.glob("*.parquet"))
    timed = []
    for work in (lambda: ours(program, graph, files), lambda: theirs(files)):
        start = time.perf_counter()
        found = work()
        timed.append((time.perf_counter() - start, found))
    (mine, our_errors), (other, their_errors) = timed
    print(f"{machine.name}: {mine:.3g} s here, {other:.3g} s with pandas and scikit-learn, {other / mine:.3g} times", flush=True)
    for node in sorted(our_errors):
        print(f"  {node}: RMSE {our_errors[node]:.4g} and {their_errors[node]:.4g}")

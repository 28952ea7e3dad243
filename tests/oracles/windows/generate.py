"""Statistics over trailing windows, lags, differences, a regular clock, first-order lags, arithmetic and the Hampel filter, by pandas
and scipy, of a series with irregular times, absent values and spikes. Writes input.csv and one table for each kind of node. No
library has the minimum difference, which is told from its definition; ../minimum_difference has it from a solver."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.constants import inch, milli
from scipy.signal import cont2discrete
from scipy.stats import linregress, median_abs_deviation

HERE = Path(__file__).parent
random = np.random.default_rng(11)
rows = 400
ms = np.cumsum(np.maximum(1, np.round(random.exponential(3000, rows)))).astype(np.int64)
ms[200:] += 90_000  # a gap that is longer than some windows
t = ms / 1000
y = 20 + np.sin(t / 90) + 1e-3 * random.standard_normal(rows)
y[random.choice(rows, 12, replace=False)] += random.choice([-5.0, 7.0], 12)
z = np.round((3 + 0.2 * np.cos(t / 150) + 0.004 * random.standard_normal(rows)) / 0.0125) * 0.0125
y, z = y.round(6), z.round(4)
y[random.random(rows) < 0.08] = np.nan
z[random.random(rows) < 0.3] = np.nan
table = pd.DataFrame({"t": t, "y": y, "z": z})
table.to_csv(HERE / "input.csv", index=False)
at = pd.to_datetime(ms, unit="ms")


def write(name, records, columns):
    text = [",".join(columns)]
    for record in records:
        cells = ["" if isinstance(c, float) and np.isnan(c) else str(c) for c in record]
        text.append(",".join(cells))
    (HERE / name).write_text("\n".join(text) + "\n")


moving, lines, filtered, lagged, differences, regular, followed, kept = [], [], [], [], [], [], [], []
for name in ["y", "z"]:
    series = pd.Series(table[name].to_numpy(), index=at).dropna()
    number = [int(row) for row in np.flatnonzero(table[name].notna())]
    for window in [20, 60, 150]:
        rolling = series.rolling(f"{window}s", closed="right", min_periods=1)
        # Not rolling.std(), which carries rounding on from window to window.
        spread = rolling.apply(lambda values: np.std(values, ddof=1) if len(values) > 1 else np.nan, raw=True)
        columns = [rolling.mean(), spread, rolling.min(), rolling.max(), rolling.median(), rolling.count()]
        for i, row in enumerate(number):
            moving.append([name, window, row, *[float(c.iloc[i]) for c in columns]])
        for i, row in enumerate(number):
            within = series[(series.index > series.index[i] - pd.Timedelta(seconds=window)) & (series.index <= series.index[i])]
            x = (within.index - series.index[i]).total_seconds().to_numpy()
            if len(within) < 3:
                continue
            fit = linregress(x, within.to_numpy())
            # Of equal samples linregress leaves open what follows from r; the line misses none of them.
            varies = np.ptp(within.to_numpy()) > 0
            share = float(fit.rvalue**2) if varies else float("nan")
            error = float(fit.stderr) if varies else 0.0
            lines.append([name, window, row, float(fit.slope), error, float(fit.intercept), share])
    for window, threshold, floor in [(60, 3.0, 0.0), (60, 3.0, 0.02), (150, 4.5, 0.0)]:
        for i, row in enumerate(number):
            within = series[(series.index > series.index[i] - pd.Timedelta(seconds=window)) & (series.index <= series.index[i])]
            median = float(np.median(within))
            allowed = max(threshold * float(median_abs_deviation(within, scale="normal")), floor)
            judged = len(within) >= 3
            outlier = float(abs(within.iloc[-1] - median) > allowed) if judged else float("nan")
            filtered.append([name, window, threshold, floor, row, median, outlier])
    here = pd.DataFrame({"at": series.index, "value": series.to_numpy()})
    for lag, age in [(0, 10), (7, 10), (30, 10), (30, 4)]:
        asked = pd.DataFrame({"at": series.index - pd.Timedelta(seconds=lag)})
        found = pd.merge_asof(asked, here, on="at", tolerance=pd.Timedelta(seconds=age))["value"]
        for i, row in enumerate(number):
            lagged.append([name, lag, age, row, float(found[i])])
            if lag > 0:
                differences.append([name, lag, age, row, float(series.iloc[i] - found[i])])
    before = series.diff().where(series.index.to_series().diff() <= pd.Timedelta(seconds=10))
    for i, row in enumerate(number):
        differences.append([name, 0, 10, row, float(before.iloc[i])])
    for every in [10, 30]:
        bins = series.resample(f"{every}s", closed="right", label="right", origin="epoch")
        for end, mean, last, count in zip(bins.mean().index, bins.mean(), bins.last(), bins.count()):
            regular.append([name, every, int(end.timestamp()), float(mean), float(last), int(count)])
    seconds, values = t[number], series.to_numpy()
    for tau in [5, 60, 900]:
        state = values[0]
        for i, row in enumerate(number):
            if i > 0:
                [[_, b]], [_, a], _ = cont2discrete(([1.0], [tau, 1.0]), seconds[i] - seconds[i - 1], "zoh")
                state = float(b * values[i - 1] - a * state)
            followed.append([name, tau, row, state, float(values[i] - state)])
    for least in [0.005, 0.3]:
        last = values[0]
        for value, row in zip(values, number):
            last = value if abs(value - last) >= least else last
            kept.append([name, least, row, float(last)])
held = [pd.DataFrame({"at": at, name: table[name]}).dropna() for name in ["y", "z"]]
asked = held[1].rename(columns={"z": "measured"})
for column in held:
    asked = pd.merge_asof(asked, column, on="at", tolerance=pd.Timedelta(seconds=10))
sampled = [[int(row), float(y), float(z)] for row, y, z in zip(np.flatnonzero(table["z"].notna()), asked["y"], asked["z"])]
ticks = pd.DataFrame({"row": np.arange(rows), "at": at})[table[["y", "z"]].notna().any(axis=1)]
for column in held:
    ticks = pd.merge_asof(ticks, column, on="at", tolerance=pd.Timedelta(seconds=10))
columns = [0.5 * ticks["y"] - 2.5 * ticks["z"], ticks["y"] * ticks["z"]]
together = [[int(row), float(a), float(b)] for row, a, b in zip(ticks["row"], *columns)]
inches = [[name, int(row), 2.5 * table[name][row] * milli / inch - 0.1] for name in ["y", "z"] for row in np.flatnonzero(table[name].notna())]
write("first_order.csv", followed, ["channel", "tau", "row", "value", "difference"])
write("minimum_difference.csv", kept, ["channel", "difference", "row", "value"])
write("together.csv", together, ["row", "sum", "product"])
write("scale.csv", inches, ["channel", "row", "inches"])
write("moving.csv", moving, ["channel", "window", "row", "mean", "std", "min", "max", "median", "count"])
write("lines.csv", lines, ["channel", "window", "row", "slope", "stderr", "value", "r2"])
write("hampel.csv", filtered, ["channel", "window", "threshold", "floor", "row", "median", "outlier"])
write("lag.csv", lagged, ["channel", "lag", "max_age", "row", "value"])
write("difference.csv", differences, ["channel", "over", "max_age", "row", "value"])
write("resample.csv", regular, ["channel", "every", "end", "mean", "last", "count"])
write("sampled.csv", sampled, ["row", "y", "z"])

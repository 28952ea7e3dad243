"""Weights of two stacked voters: out-of-fold predictions by scikit-learn, the weights by scipy. One voter has two temperatures, the other those
of five instants, which are too many for so few rows. Writes input.csv and expected.csv, the weights of both."""

from pathlib import Path

import numpy as np
from scipy.optimize import nnls
from sklearn.linear_model import LinearRegression

HERE = Path(__file__).parent
random = np.random.default_rng(23)
rows, lags, folds = 60, 5, 3
temperatures = ([21, 30] + np.cumsum(random.uniform(-1, 1, (rows, 2)) * [0.1, 0.2], axis=0)).round(9)
position = (temperatures @ [40, -25] + 5 * random.uniform(-1, 1, rows)).round(9)
table = np.column_stack([temperatures, position])
np.savetxt(HERE / "input.csv", table, fmt="%.9f", delimiter=",", header="room,chuck,Z", comments="")

past = np.full((rows, 2 * lags), np.nan)
for lag in range(lags):
    past[lag:, 2 * lag : 2 * lag + 2] = temperatures[: rows - lag]
edges = [rows * nth // folds for nth in range(folds + 1)]
predictions = np.full((rows, 2), np.nan)
for voter, regressors in enumerate([temperatures, past]):
    there = ~np.isnan(regressors).any(axis=1)
    for start, end in zip(edges, edges[1:]):
        fold = (np.arange(rows) >= start) & (np.arange(rows) < end)
        fit = LinearRegression().fit(regressors[there & ~fold], position[there & ~fold])
        predictions[there & fold, voter] = fit.predict(regressors[there & fold])
both = ~np.isnan(predictions).any(axis=1)
weights, _ = nnls(predictions[both], position[both])
(HERE / "expected.csv").write_text("plain,rich\n" + ",".join(repr(float(weight)) for weight in weights) + "\n")

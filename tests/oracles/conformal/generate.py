"""Adaptive conformal inference (Gibbs and Candès 2021) in a few lines of numpy, on errors that grow and grow heavy tails.

python 3.11, numpy 2.3. Run it in this folder; it is seeded and writes expected.csv: a row per second with a prediction, the
truth that comes right after it, and the interval given before. Coverage 0.8, gain 0.05, memory 60 s.
"""
import math

import numpy as np

COVERAGE, GAIN, MEMORY = 0.8, 0.05, 60
r = np.random.default_rng(21)
n = 1000
scale = np.where(np.arange(n) < 500, 1.0, 4.0)
prediction = np.cumsum(r.standard_normal(n))
truth = prediction + scale * np.where(r.random(n) < 0.9, r.standard_normal(n), 5.0 * r.standard_t(2, n))

alpha, inside = 1.0 - COVERAGE, []
with open("expected.csv", "w") as out:
    print("prediction,truth,lower,upper", file=out)
    for i in range(n):
        errors = np.abs(truth - prediction)[max(0, i - MEMORY + 1) : i]
        cells = [repr(float(prediction[i])), repr(float(truth[i])), "", ""]
        if math.ceil(round((len(errors) + 1) * COVERAGE, 9)) <= len(errors):
            rank = math.ceil(round((len(errors) + 1) * (1.0 - alpha), 9))
            reach = 0.0 if rank < 1 else np.partition(errors, min(rank, len(errors)) - 1)[min(rank, len(errors)) - 1]
            lower, upper = prediction[i] - reach, prediction[i] + reach
            cells[2:] = [repr(float(lower)), repr(float(upper))]
            miss = not lower <= truth[i] <= upper
            inside.append(not miss)
            alpha = min(max(alpha + GAIN * (1.0 - COVERAGE - miss), 0.0), 1.0)
        print(",".join(cells), file=out)
assert abs(np.mean(inside) - COVERAGE) < 0.02, np.mean(inside)

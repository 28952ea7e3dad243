"""Weights of votes: memories of errors by pandas, floors by scipy, exponential weights by river and by the algorithm of AdaHedge as its
authors print it. Writes input.csv (the truth, three votes) and one table for each, the weights before the truth of a row is known."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
from river import base, ensemble, optim
from scipy.optimize import brentq
from scipy.special import logsumexp

HERE = Path(__file__).parent
random = np.random.default_rng(23)
rows, voters = 300, 3
seconds = np.cumsum(np.round(random.uniform(40, 110, rows))).astype(np.int64)
truth = 40 * np.sin(seconds / 900) + random.standard_normal(rows)
noise = random.standard_normal((rows, voters)) * [3.0, 5.0, 9.0]
# The third is the best from the middle on.
noise[150:] *= [2.5, 1.0, 0.2]
votes = truth[:, None] + noise
# The widest error comes first, so that what errors are scaled by is known from then on.
votes[0] = truth[0] + np.array([0.5, 2.0, 60.0])
truth, votes = truth.round(6), votes.round(6)
squares = (votes - truth[:, None]) ** 2


def write(name, records, columns):
    lines = [",".join(columns)]
    lines += [",".join(repr(c) if isinstance(c, int) else repr(float(c)) for c in record) for record in records]
    (HERE / name).write_text("\n".join(lines) + "\n")


write("input.csv", [[int(s), y, *v] for s, y, v in zip(seconds, truth, votes)], ["t", "truth", "a", "b", "c"])


def inverse_square(means):
    return (1 / means) / np.sum(1 / means)


def raised(weights, floor):
    """The weights nearest to these, in the sense of Kullback and Leibler, that are not below the floor."""
    if floor * len(weights) >= 1:
        return np.full(len(weights), 1 / len(weights))
    scale = brentq(lambda c: np.sum(np.maximum(floor, c * weights)) - 1, 0, 1.5, xtol=1e-16, rtol=8.9e-16)
    return np.maximum(floor, scale * weights)


at = pd.to_datetime(seconds, unit="s")
frame = pd.DataFrame(squares, index=at)
memories = {
    "truths": frame.rolling(12, min_periods=1).mean().to_numpy(),
    "half_life": frame.ewm(halflife="10min", times=at).mean().to_numpy(),
}
for name, means in memories.items():
    records = []
    for row in range(1, rows):
        plain = inverse_square(means[row - 1])
        shrunk = 0.7 * plain + 0.3 / voters
        records.append([row, *plain, *shrunk, *raised(plain, 0.15), *raised(shrunk, 0.2)])
    kinds = ["plain", "shrunk", "raised", "both"]
    write(f"{name}.csv", records, ["row"] + [f"{kind}_{v}" for kind in kinds for v in "abc"])


class Said(base.Regressor):
    """Says what it is given."""

    def __init__(self, which):
        self.which = which

    def learn_one(self, x, y):
        pass

    def predict_one(self, x):
        return x[self.which]


records = {row: [row] for row in range(1, rows)}
widest = squares[0].max() - squares[0].min()
rate = 0.8
mixture = ensemble.EWARegressor([Said(v) for v in range(voters)], loss=optim.losses.Squared(), learning_rate=rate)
for row in range(rows):
    if row > 0:
        total = sum(mixture.weights)
        records[row] += [w / total for w in mixture.weights]
    scale = math.sqrt(widest)
    mixture.learn_one({v: votes[row, v] / scale for v in range(voters)}, truth[row] / scale)

# AdaHedge: de Rooij, van Erven, Grünwald and Koolen (2014), figure 1.
losses, gap = np.zeros(voters), 0.0
for row in range(rows):
    eta = math.log(voters) / gap if gap > 0 else math.inf

    def mix(total):
        least = total.min()
        if math.isinf(eta):
            weights = (total == least) / np.sum(total == least)
            return weights, least
        weights = np.exp(-eta * (total - least))
        return weights / weights.sum(), least - (logsumexp(-eta * (total - least)) - math.log(voters)) / eta

    weights, before = mix(losses)
    if row > 0:
        records[row] += list(weights)
    hedge = float(weights @ squares[row])
    losses = losses + squares[row]
    _, after = mix(losses)
    gap += max(0.0, hedge - (after - before))
write("hedge.csv", records.values(), ["row"] + [f"{kind}_{v}" for kind in ["river", "adahedge"] for v in "abc"])

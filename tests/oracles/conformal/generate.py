"""Adaptive conformal inference (Gibbs and Candès 2021) in a few lines of numpy, on errors that grow and grow heavy tails.

python 3.11, numpy 2.4. Run it in this folder; it is seeded and writes expected.csv: a row per second with a prediction, the
truth that comes right after it, and the interval given before. Coverage 0.9, gain 0.2, memory 60 s. The gain is so large that
α falls below 0 and comes back many times.
"""
import math

import numpy as np

COVERAGE, GAIN, MEMORY = 0.9, 0.2, 60
r = np.random.default_rng(21)
n = 1000
scale = np.where(np.arange(n) < 500, 1.0, 4.0)
prediction = np.cumsum(r.standard_normal(n))
truth = prediction + scale * np.where(r.random(n) < 0.9, r.standard_normal(n), 5.0 * r.standard_t(2, n))


def run(infinite):
    """The reach at each instant, none before there are enough errors, and every α; as the source says with infinite sets, or with
    the largest error in their place, where α is held within the bounds of the source's lemma 4.1."""
    alpha, reaches, alphas = 1.0 - COVERAGE, [], []
    for i in range(n):
        errors = np.sort(np.abs(truth - prediction)[max(0, i - MEMORY + 1) : i])
        if math.ceil(round((len(errors) + 1) * COVERAGE, 9)) > len(errors):
            reaches.append(None)
            continue
        rank = math.ceil(round((len(errors) + 1) * (1.0 - alpha), 9))
        if rank > len(errors):
            reach = math.inf if infinite else errors[-1]
        else:
            reach = errors[rank - 1] if rank >= 1 else 0.0
        reaches.append(reach)
        miss = abs(truth[i] - prediction[i]) > reach
        alpha += GAIN * (1.0 - COVERAGE - miss)
        if not infinite:
            alpha = min(max(alpha, -GAIN), 1.0 + GAIN)
        alphas.append(alpha)
    return reaches, alphas


def share(reaches):
    return np.mean([abs(t - p) <= q for t, p, q in zip(truth, prediction, reaches) if q is not None])


_, alphas = run(infinite=True)
assert -GAIN <= min(alphas) < 0.0 and max(alphas) <= 1.0 + GAIN, "lemma 4.1"
reaches, alphas = run(infinite=False)
assert sum(alpha < 0.0 for alpha in alphas) > 50
# Proposition 4.1: with α held to 0 to 1 the share would be 0.875.
assert abs(share(reaches) - COVERAGE) <= (COVERAGE + GAIN) / (len(alphas) * GAIN), share(reaches)
with open("expected.csv", "w") as out:
    print("prediction,truth,lower,upper", file=out)
    for p, t, q in zip(prediction, truth, reaches):
        ends = ["", ""] if q is None else [repr(float(p - q)), repr(float(p + q))]
        print(",".join([repr(float(p)), repr(float(t)), *ends]), file=out)

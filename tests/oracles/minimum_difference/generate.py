"""The filter by the minimum difference as a mixed-integer program, which HiGHS solves: no sample is gone through in turn, all that is
said are the conditions that the kept values meet at once.

python 3.11, numpy 2.3, scipy 1.17. Run it in this folder; it is seeded and writes cases.csv: the case, the least difference, the
sample (empty where it is absent) and the value that is kept, in mm. All are multiples of 1/8 mm, so that a difference may be
the least one exactly.
"""
import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

random = np.random.default_rng(17)
FAR = 10_000.0


def kept(x, least):
    """In whole eighths: y is x or the y before it. It is x where x rose or fell by `least`, and else by less than that."""
    n = len(x)
    # Per sample: the kept value, whether it is the sample, and whether it rose to it.
    y, new, rose = np.arange(n), n + np.arange(n), 2 * n + np.arange(n)
    rows, low, high = [], [], []

    def holds(terms, least_sum, most_sum):
        row = np.zeros(3 * n)
        for column, factor in terms:
            row[column] += factor
        rows.append(row)
        low.append(least_sum)
        high.append(most_sum)

    holds([(y[0], 1)], x[0], x[0])
    holds([(new[0], 1)], 1, 1)
    for t in range(1, n):
        before = y[t - 1]
        # If it is new, it is the sample.
        holds([(y[t], 1), (new[t], FAR)], -np.inf, x[t] + FAR)
        holds([(y[t], 1), (new[t], -FAR)], x[t] - FAR, np.inf)
        # If it is not, it is what was kept before, from which the sample differs by less.
        holds([(y[t], 1), (before, -1), (new[t], -FAR)], -np.inf, 0)
        holds([(y[t], 1), (before, -1), (new[t], FAR)], 0, np.inf)
        holds([(before, 1), (new[t], FAR)], x[t] - least + 1, np.inf)
        holds([(before, 1), (new[t], -FAR)], -np.inf, x[t] + least - 1)
        # If it is new, it rose or fell by that at least.
        holds([(before, 1), (new[t], FAR), (rose[t], FAR)], -np.inf, x[t] - least + 2 * FAR)
        holds([(before, 1), (new[t], -FAR), (rose[t], FAR)], x[t] + least - FAR, np.inf)
    bounds = Bounds(np.r_[np.full(n, -FAR), np.zeros(2 * n)], np.r_[np.full(n, FAR), np.ones(2 * n)])
    found = milp(
        np.zeros(3 * n),
        constraints=LinearConstraint(np.array(rows), low, high),
        integrality=np.ones(3 * n),
        bounds=bounds,
        options={"time_limit": 60},
    )
    assert found.success, found.message
    return np.round(found.x[:n]).astype(int)


lines = ["case,least,sample,kept"]
for case in range(12):
    n = 60
    steps = random.integers(-6, 7, n)
    x = random.integers(-500, 500) + (np.cumsum(steps) if case % 2 else 20 * np.sin(np.arange(n) / 9) + steps).astype(int)
    least = int(random.integers(1, 25))
    absent = random.random(n) < 0.1 * (case % 3)
    there = np.flatnonzero(~absent)
    found = dict(zip(there, kept(x[there], least)))
    for t in range(n):
        cells = [f"{x[t] / 8}", f"{found[t] / 8}"] if t in found else ["", ""]
        lines.append(",".join([str(case), f"{least / 8}", *cells]))
with open("cases.csv", "w") as file:
    file.write("\n".join(lines) + "\n")

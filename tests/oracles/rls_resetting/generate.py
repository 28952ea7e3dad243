"""Recursive least squares whose past fades to a share of the fit, by the formula itself and by all rows at once.

At each row R <- lambda R + (1 - lambda) beta R0 + x x' and b likewise, beta = 0.1, lambda = exp(-dt / memory), and theta is
`numpy.linalg.solve(R, b)`. That is checked here against the weighted problem of all rows so far, in which row i counts
exp(-(t_n - t_i) / memory) and the fit what is left of it and its share. `spread` is x'Px of the row before it was learned.

Run: python generate.py (numpy 2.4.6).
"""

import numpy as np

MEMORY, BETA = 400.0, 0.1
random = np.random.default_rng(66)
rows, width = 300, 4
x = random.standard_normal((rows, width))
x[150:, 1] = x[150:, 0] * 1e-3  # a direction that nothing excites any more
x[:, -1] = 1.0
before, after = np.array([2.0, -1.0, 3.0, 0.5]), np.array([2.5, 1.0, 2.0, -0.5])
y = np.array([x[i] @ (before if i < 60 else after) for i in range(rows)]) + 0.1 * random.standard_normal(rows)
gaps = random.choice([0.0, 1.0, 10.0, 75.0, 300.0], rows, p=[0.1, 0.4, 0.3, 0.15, 0.05])
z = random.standard_normal((200, width))
z[:, -1] = 1.0
start_r, start = z.T @ z, before + 0.05 * random.standard_normal(width)

r, b = start_r.copy(), start_r @ start
theta, elapsed = start, np.cumsum(gaps)
cells = [(i, j) for i in range(width) for j in range(i + 1)]
with open("start.csv", "w") as out:
    print(*(f"r{i}{j}" for i, j in cells), *(f"t{i}" for i in range(width)), sep=",", file=out)
    print(*(repr(float(start_r[i, j])) for i, j in cells), *(repr(float(v)) for v in start), sep=",", file=out)
with open("rows.csv", "w") as out:
    print("after_s", *(f"x{i}" for i in range(width)), "y", sep=",", file=out)
    for i in range(rows):
        print(*(repr(float(v)) for v in [gaps[i], *x[i], y[i]]), sep=",", file=out)
with open("expected.csv", "w") as out:
    print("error,spread", *(f"t{i}" for i in range(width)), sep=",", file=out)
    for i in range(rows):
        error, spread = y[i] - x[i] @ theta, x[i] @ np.linalg.solve(r, x[i])
        left = np.exp(-gaps[i] / MEMORY)
        r = left * r + (1 - left) * BETA * start_r + np.outer(x[i], x[i])
        b = left * b + (1 - left) * BETA * (start_r @ start) + x[i] * y[i]
        theta = np.linalg.solve(r, b)
        weights = np.exp(-(elapsed[i] - elapsed[: i + 1]) / MEMORY)
        of_fit = np.exp(-elapsed[i] / MEMORY) + BETA * (1 - np.exp(-elapsed[i] / MEMORY))
        at_once = (x[: i + 1] * weights[:, None]).T @ x[: i + 1] + of_fit * start_r
        assert np.allclose(at_once, r, rtol=1e-10)
        assert np.linalg.eigvalsh(r - BETA * start_r).min() > -1e-9, "P is at most P0 / beta"
        print(*(repr(float(v)) for v in [error, spread, *theta]), sep=",", file=out)

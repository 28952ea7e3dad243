"""Recursive least squares with variable forgetting, by solving the weighted problem anew at each row.

Independent of the recursion: at each row the coefficients are those of `numpy.linalg.lstsq` on all rows so far, weighted by the
product of the later factors, with the prior (variance 100 of each coefficient) as rows of its own that are weighted likewise.
The factor is that of Fortescue, Kershenbaum and Ydstie (1981): lambda = 1 - e^2 (1 - x'K) / (memory * noise^2), at least
`lowest`, where 1 - x'K = 1 / (1 + x'Px), P the inverse of the weighted normal matrix of the rows before.

Run: python generate.py (numpy 2.3.5).
"""

import numpy as np

MEMORY, NOISE, LOWEST, PRIOR = 200.0, 0.1, 0.8, 100.0
random = np.random.default_rng(21)
rows, width = 250, 3
x = random.standard_normal((rows, width))
x[:, 2] = 1.0
before, after = np.array([2.0, -1.0, 3.0]), np.array([2.5, 1.0, 2.0])
y = np.array([x[i] @ (before if i < 120 else after) for i in range(rows)]) + NOISE * random.standard_normal(rows)

design = np.eye(width) / np.sqrt(PRIOR)
target = np.zeros(width)
weights = np.ones(width)
coefficients = np.zeros(width)
with open("rows.csv", "w") as out:
    print("x0,x1,x2,y", file=out)
    for i in range(rows):
        print(*(repr(float(v)) for v in [*x[i], y[i]]), sep=",", file=out)
with open("expected.csv", "w") as out:
    print("factor,error,t0,t1,t2", file=out)
    for i in range(rows):
        normal = (design * weights[:, None]).T @ design
        spread = x[i] @ np.linalg.solve(normal, x[i])
        error = y[i] - x[i] @ coefficients
        factor = max(1.0 - error**2 / (1.0 + spread) / (MEMORY * NOISE**2), LOWEST)
        design, target = np.vstack([design, x[i]]), np.append(target, y[i])
        weights = np.append(weights * factor, 1.0)
        root = np.sqrt(weights)
        coefficients = np.linalg.lstsq(design * root[:, None], target * root, rcond=None)[0]
        print(*(repr(float(v)) for v in [factor, error, *coefficients]), sep=",", file=out)

"""Forward regression with error-reduction ratios by SysIdentPy, on the monomials of a simulated system of second order.

python 3.11, numpy, sysidentpy 0.9.0. Run it here; it writes terms.csv (one monomial per column, the target last) and
expected.json (the columns in the order in which they are chosen, their ratios and coefficients).
"""

import json

import numpy as np
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

rng = np.random.default_rng(5)
rows = 400
u = rng.uniform(-1, 1, rows)
y = np.zeros(rows)
for k in range(2, rows):
    y[k] = (
        0.5 * y[k - 1] - 0.2 * y[k - 2] + 0.7 * u[k - 1] + 0.3 * u[k - 1] ** 2
        - 0.25 * y[k - 1] * u[k - 2] + 0.1 + 0.05 * rng.standard_normal()
    )
y = np.round(y, 6)
u = np.round(u, 6)
basis = Polynomial(degree=2)
model = FROLS(
    ylag=2, xlag=2, n_terms=9, order_selection=False,
    basis_function=basis, estimator=LeastSquares(),
)
model.fit(X=u.reshape(-1, 1), y=y.reshape(-1, 1))
order = [int(i) for i in model.pivv[:9]]
# The matrix of all monomials of (y1, y2, u1, u2), as SysIdentPy orders them.
lagged = np.column_stack([y[1:-1], y[:-2], u[1:-1], u[:-2]])
names = ["1", "y1", "y2", "u1", "u2"]
columns, codes = [], []
with_one = np.column_stack([np.ones(len(lagged)), lagged])
for i in range(5):
    for j in range(i, 5):
        columns.append(with_one[:, i] * with_one[:, j])
        codes.append(f"{names[i]}*{names[j]}")
terms = np.column_stack(columns)
target = y[2:]
solution = np.linalg.lstsq(terms[:, order], target, rcond=None)[0]
assert np.allclose(solution, np.asarray(model.theta).ravel(), atol=1e-9), (solution, model.theta)
with open("terms.csv", "w") as file:
    file.write(",".join(codes + ["target"]) + "\n")
    for row, value in zip(terms, target):
        file.write(",".join(repr(float(x)) for x in [*row, value]) + "\n")
with open("expected.json", "w") as file:
    json.dump(
        {
            "order": order,
            "err": [float(e) for e in np.asarray(model.err)[:9]],
            "theta": [float(t) for t in np.asarray(model.theta).ravel()],
        },
        file, indent=1,
    )
    file.write("\n")

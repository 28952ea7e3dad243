"""Subspace identification by sippy_unipi (N4SID, MOESP, CVA) of a simulated system with two inputs.

python 3.11, numpy, sippy_unipi. Run it here; it writes record.csv (two inputs, one output, each without its mean) and
expected.json: for each weighting the eigenvalues of A, the responses to impulses of each input and of the innovation, and the
singular values over the root of the number of windows.
"""

import json

import numpy as np
from sippy_unipi.OLSims_methods import OLSims, SVD_weighted

HORIZON, ORDER, SAMPLES = 8, 3, 12
rng = np.random.default_rng(3)
rows = 600
a = np.array([[0.8, 0.2, 0.0], [-0.2, 0.7, 0.1], [0.0, 0.0, 0.5]])
b = np.array([[0.5, 0.1], [0.2, -0.4], [0.3, 0.6]])
c = np.array([1.0, 0.5, 0.8])
d = np.array([0.3, -0.2])
k = np.array([0.4, 0.1, 0.2])
u = rng.standard_normal((rows, 2))
x = np.zeros(3)
y = np.zeros(rows)
for t in range(rows):
    e = 0.2 * rng.standard_normal()
    y[t] = c @ x + d @ u[t] + e
    x = a @ x + b @ u[t] + k * e
u = np.round(u - u.mean(0), 6)
y = np.round(y - y.mean(), 6)
windows = rows - 2 * HORIZON + 1
expected = {}
for weights in ("N4SID", "MOESP", "CVA"):
    A, B, C, D, _, _, _, _, K = OLSims(
        y[None, :].copy(), u.T.copy(), HORIZON, weights=weights, fixed_order=ORDER, D_required=True
    )
    state = {"0": B[:, 0], "1": B[:, 1], "noise": K[:, 0]}
    response = {}
    for name, start in state.items():
        now, values = start.astype(float), []
        for _ in range(SAMPLES):
            values.append(float(C[0] @ now))
            now = A @ now
        response[name] = values
    ystd, ustd = y.std(), u.std(0)
    _, singular, *_ = SVD_weighted(y[None, :] / ystd, (u / ustd).T, HORIZON, 1, weights)
    expected[weights] = {
        "moduli": sorted(float(abs(p)) for p in np.linalg.eigvals(A)),
        "response": response,
        "direct": [float(v) for v in D[0]],
        "singular": [float(s) / (1.0 if weights == "CVA" else np.sqrt(windows)) for s in singular],
    }
with open("record.csv", "w") as file:
    file.write("u0,u1,y\n")
    for inputs, output in zip(u, y):
        file.write(f"{inputs[0]:.6f},{inputs[1]:.6f},{output:.6f}\n")
with open("expected.json", "w") as file:
    json.dump({"horizon": HORIZON, "order": ORDER, "by": expected}, file, indent=1)
    file.write("\n")

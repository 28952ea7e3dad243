"""Non-negative least squares by scipy. Writes problems.csv, a row of a problem each, and expected.csv."""

from pathlib import Path

import numpy as np
from scipy.optimize import nnls

HERE = Path(__file__).parent
random = np.random.default_rng(5)
problems, expected = [], []
for number in range(24):
    order = 2 + number % 7
    rows = 30
    truth = random.standard_normal(rows) * 10 ** random.uniform(-3, 3)
    # Voters of the same truth: nearly collinear, some of them wrong in sign or in size.
    size = np.where(random.random(order) < 0.2, -1, 1) * random.uniform(0.3, 2, order)
    noise = random.standard_normal((rows, order)) * random.uniform(0.01, 1, order) * np.std(truth)
    X = (truth[:, None] * size + noise).round(9)
    y = truth.round(9)
    weights, _ = nnls(X, y)
    for row, target in zip(X, y):
        problems.append([number, *row, target])
    expected.append([number, *weights])


def write(name, records):
    lines = [",".join(repr(float(cell)) for cell in record) for record in records]
    (HERE / name).write_text("\n".join(lines) + "\n")


write("problems.csv", problems)
write("expected.csv", expected)

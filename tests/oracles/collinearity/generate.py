"""Variance inflation factors by statsmodels, condition number of the standardised design by numpy.

Writes input.csv and expected.csv beside itself; relative tolerance 1e-9.
"""
from pathlib import Path

import numpy as np
from statsmodels.stats.outliers_influence import variance_inflation_factor

here = Path(__file__).parent
random = np.random.default_rng(20)
base = random.normal(size=(300, 4))
x = np.column_stack([
    base[:, 0] + 20.0,
    3.0 * base[:, 0] + 0.2 * base[:, 1] - 5.0,
    base[:, 1] + 0.5 * base[:, 2],
    1e3 * (base[:, 3] - base[:, 0]),
])
design = np.column_stack([np.ones(len(x)), x])
factors = [variance_inflation_factor(design, column) for column in range(1, 5)]
standard = (x - x.mean(axis=0)) / x.std(axis=0)
condition = np.linalg.cond(standard)
lines = ["a,b,c,d"] + [",".join(repr(float(v)) for v in row) for row in x]
(here / "input.csv").write_text("\n".join(lines) + "\n")
values = ",".join(repr(float(v)) for v in [*factors, condition])
(here / "expected.csv").write_text(f"a,b,c,d,condition\n{values}\n")

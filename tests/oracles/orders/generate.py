"""Orders of an autoregression compared on the same rows by statsmodels.

python 3.11, numpy 2.3, statsmodels 0.15. Run it in this folder; it is seeded and writes series.csv and expected.json. `hold_back`
keeps the rows the same for all orders. The criteria of statsmodels contain the constant N (1 + ln 2π), which is left out here.
"""
import json

import numpy as np
from statsmodels.tsa.ar_model import AutoReg

r = np.random.default_rng(5)
y = [0.0, 0.0]
for _ in range(298):
    y.append(0.5 * y[-1] - 0.6 * y[-2] + 0.3 * r.standard_normal())
y = np.round(np.array(y) + 4.0, 9)
with open("series.csv", "w") as file:
    file.write("time_s,y\n" + "".join(f"{10 * i},{v}\n" for i, v in enumerate(y)))
MOST = 6
expected = []
for order in range(1, MOST + 1):
    fit = AutoReg(y, lags=order, trend="c", hold_back=MOST).fit()
    n = fit.nobs
    constant = n * (1.0 + np.log(2.0 * np.pi))
    expected.append({"na": order, "rows": int(n), "aic": fit.aic - constant, "aicc": fit.aicc - constant,
                     "bic": fit.bic - constant, "fpe": float(fit.fpe)})
with open("expected.json", "w") as file:
    json.dump(expected, file, indent=1)

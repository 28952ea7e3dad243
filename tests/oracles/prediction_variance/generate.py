"""Standard deviations of predictions: ordinary least squares by statsmodels, ridge by a Gaussian process of scikit-learn.

python 3.11, numpy 2.3, statsmodels 0.15, scikit-learn 1.9. Run it in this folder; it is seeded and writes rows.csv (what is
fitted), expected.csv (where is predicted, and both deviations of an observation about its prediction) and errors.csv (the standard
errors of the intercept and of the coefficients).

Ridge on standardised columns is the posterior mean under a prior of variance s²/alpha for each coefficient, so a Gaussian
process with a linear kernel has the same predictions and tells their deviations. Its intercept is free, which adds s²/n.
"""
import numpy as np
import statsmodels.api as sm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, DotProduct
from sklearn.linear_model import Ridge

ALPHA = 5.0
r = np.random.default_rng(4)
n = 120
x = r.standard_normal((n, 4)) * [1.0, 30.0, 1.0, 0.02] + [20.0, -5.0, 0.0, 1.0]
x[:, 0] += 0.03 * x[:, 1]
x[:, 2] = 7.0
y = 2.0 * x[:, 0] - 0.1 * x[:, 1] + 40.0 * x[:, 3] + r.standard_normal(n)
at = r.standard_normal((25, 4)) * [2.0, 60.0, 0.0, 0.05] + [20.0, -5.0, 7.0, 1.0]
used = [0, 1, 3]

ols = sm.OLS(y, sm.add_constant(x[:, used])).fit()
ordinary = ols.get_prediction(sm.add_constant(at[:, used])).se_obs

mean, scale = x[:, used].mean(axis=0), x[:, used].std(axis=0)
z, at_z = (x[:, used] - mean) / scale, (at[:, used] - mean) / scale
ridge = Ridge(alpha=ALPHA).fit(z, y)
effective = 1 + np.trace(z @ np.linalg.solve(z.T @ z + ALPHA * np.eye(3), z.T))
noise = np.sum((y - ridge.predict(z)) ** 2) / (n - effective)
kernel = ConstantKernel(noise / ALPHA) * DotProduct(sigma_0=0.0, sigma_0_bounds="fixed")
process = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None).fit(z, y - y.mean())
mean_of_process, of_process = process.predict(at_z, return_std=True)
assert np.allclose(mean_of_process + y.mean(), ridge.predict(at_z), atol=1e-8)
penalised = np.sqrt(of_process**2 + noise + noise / n)

covariance = noise * np.linalg.inv(z.T @ z + ALPHA * np.eye(3))
errors = np.sqrt(np.r_[noise / n + (mean / scale) @ covariance @ (mean / scale), np.diag(covariance) / scale**2])

for name, header, columns in (
    ("rows.csv", "x0,x1,x2,x3,y", np.column_stack([x, y])),
    ("expected.csv", "x0,x1,x2,x3,ordinary,ridge", np.column_stack([at, ordinary, penalised])),
    ("errors.csv", "ordinary,ridge", np.column_stack([ols.bse, errors])),
):
    with open(name, "w") as out:
        print(header, file=out)
        for row in columns:
            print(",".join(repr(float(v)) for v in row), file=out)

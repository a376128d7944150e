# %% [markdown]
# # A kept factor on your own matrix
# A grid of springs, of which a few get stiffer again and again: the factor that is kept against SciPy's, made anew each time.

# %%
import time

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import yawara

n = 60
line = scipy.sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
k = (scipy.sparse.kron(line, scipy.sparse.eye(n)) + scipy.sparse.kron(scipy.sparse.eye(n), line)).tocsc()
inverse = yawara.SparseInverse(k)
random = np.random.default_rng(0)
f = random.normal(size=n * n)

# %%
kept_s = anew_s = worst = 0.0
for _ in range(50):
    i = int(random.integers(n * n - 1))
    spring = np.array([[1.0], [-1.0]])
    begin = time.perf_counter()
    inverse.update([i, i + 1], added=spring)
    u = inverse.solve(f)
    kept_s += time.perf_counter() - begin
    added = scipy.sparse.coo_array(((spring @ spring.T).ravel(), ([i, i, i + 1, i + 1], [i, i + 1, i, i + 1])), shape=k.shape)
    k = (k + added).tocsc()
    begin = time.perf_counter()
    expected = scipy.sparse.linalg.splu(k).solve(f)
    anew_s += time.perf_counter() - begin
    worst = max(worst, float(np.abs(u - expected).max() / np.abs(expected).max()))

# %%
print(f"update and solve {20 * kept_s:.2f} ms, factor anew {20 * anew_s:.2f} ms, ratio {anew_s / kept_s:.1f}, largest difference {worst:.1e}")
assert worst < 1e-9

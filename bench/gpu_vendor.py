"""The vendor's dense library on the same card: an inverse (cuSOLVER) and a rank-k update (cuBLAS).

Prints a table in ms; needs PyTorch with CUDA. The matrix is symmetric positive definite, full.
"""

import statistics
import sys

try:
    import torch
except ImportError:
    sys.exit("PyTorch is missing: the vendor's library is not compared")
if not torch.cuda.is_available():
    sys.exit("no CUDA device: the vendor's library is not compared")


def median_ms(call, repeats):
    """Median time of a call, the first left out."""
    times = []
    for _ in range(repeats + 1):
        begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        begin.record()
        call()
        end.record()
        torch.cuda.synchronize()
        times.append(begin.elapsed_time(end))
    return statistics.median(times[1:])


print(f"{torch.cuda.get_device_name()}, PyTorch {torch.__version__}, CUDA {torch.version.cuda}\n")
print("| vertices | type | inverse, LU | inverse, Cholesky | rank 3 | rank 30 | product |")
print("|---|---|---|---|---|---|---|")
for vertices in (728, 1024, 2048, 3456):
    for dtype in (torch.float32, torch.float64):
        n = 3 * vertices
        a = torch.randn(n, n, dtype=dtype, device="cuda") / n**0.5
        a = a @ a.T + torch.eye(n, dtype=dtype, device="cuda")
        x = torch.randn(n, 1, dtype=dtype, device="cuda")
        y = {k: torch.randn(n, k, dtype=dtype, device="cuda") for k in (3, 30)}
        c = a.clone()
        cells = [
            median_ms(lambda: torch.linalg.inv(a), 3),
            median_ms(lambda: torch.cholesky_inverse(torch.linalg.cholesky(a)), 3),
            median_ms(lambda: c.addmm_(y[3], y[3].T, alpha=1e-9), 20),
            median_ms(lambda: c.addmm_(y[30], y[30].T, alpha=1e-9), 20),
            median_ms(lambda: c @ x, 20),
        ]
        cells = " | ".join(f"{cell:.3f}" for cell in cells)
        print(f"| {vertices} | {str(dtype)[6:]} | {cells} |")

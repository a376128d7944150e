"""The vendor's dense library on the same card: an inverse (cuSOLVER) and a rank-k update (cuBLAS).

Prints a table in ms; needs PyTorch, with CUDA unless --cpu is given. The matrix is symmetric
positive definite, full. Every row has the relative error of its inverse, ‖A C − 1‖ / ‖1‖ in the
Frobenius norm, so that a time is never without it.

--cpu runs the same on the host's cores, to try this script where there is no card: its figures are
those of no vendor's library for cards, and its output says so.
"""

import argparse
import statistics
import sys
import time

try:
    import torch
except ImportError:
    sys.exit("PyTorch is missing: the vendor's library is not compared")

SIZES = (728, 1024, 2048, 3456)


def sizes(text):
    """Numbers with commas between them, each at least 1."""
    numbers = tuple(int(number) for number in text.split(","))
    if min(numbers) < 1:
        raise argparse.ArgumentTypeError(f"{min(numbers)} vertices, want at least 1")
    return numbers


def arguments():
    """What was typed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--cpu", action="store_true", help="try the script on the host's cores")
    parser.add_argument(
        "--vertices",
        type=sizes,
        default=SIZES,
        metavar="LIST",
        help="sizes, e.g. 100,200; three rows per vertex (default: the paper's)",
    )
    return parser.parse_args()


def elapsed_ms(call, is_cpu):
    """Time of a call until the device is done."""
    if is_cpu:
        begin = time.perf_counter()
        call()
        return (time.perf_counter() - begin) * 1e3
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    begin.record()
    call()
    end.record()
    torch.cuda.synchronize()
    return begin.elapsed_time(end)


def median_ms(call, repeats, is_cpu):
    """Median time of a call, the first left out."""
    return statistics.median([elapsed_ms(call, is_cpu) for _ in range(repeats + 1)][1:])


def row(vertices, dtype, is_cpu):
    """Cells of one size and precision: five times, and the inverse's error."""
    n, place = 3 * vertices, {"dtype": dtype, "device": "cpu" if is_cpu else "cuda"}
    a = torch.randn(n, n, **place) / n**0.5
    one = torch.eye(n, **place)
    a = a @ a.T + one
    x = torch.randn(n, 1, **place)
    y = {k: torch.randn(n, k, **place) for k in (3, 30)}
    error = float(torch.linalg.norm(a @ torch.linalg.inv(a) - one) / n**0.5)
    c = a.clone()
    times = [
        median_ms(lambda: torch.linalg.inv(a), 3, is_cpu),
        median_ms(lambda: torch.cholesky_inverse(torch.linalg.cholesky(a)), 3, is_cpu),
        median_ms(lambda: c.addmm_(y[3], y[3].T, alpha=1e-9), 20, is_cpu),
        median_ms(lambda: c.addmm_(y[30], y[30].T, alpha=1e-9), 20, is_cpu),
        median_ms(lambda: c @ x, 20, is_cpu),
    ]
    return [f"{cell:.3f}" for cell in times] + [f"{error:.0e}"]


def main():
    """Prints what the figures are of, and the table."""
    given = arguments()
    if given.cpu:
        print(f"The host's CPU, no card and no vendor's library: PyTorch {torch.__version__}\n")
    elif not torch.cuda.is_available():
        sys.exit("no CUDA device: the vendor's library is not compared (--cpu tries the script)")
    else:
        name, cuda = torch.cuda.get_device_name(), torch.version.cuda
        print(f"{name}, PyTorch {torch.__version__}, CUDA {cuda}\n")
    torch.manual_seed(1)
    # No TF32, which rounds the factors of f32 products to 10 bits.
    torch.set_float32_matmul_precision("highest")
    print("| vertices | type | inverse, LU | inverse, Cholesky | rank 3 | rank 30 | product | error |")
    print("|---|---|---|---|---|---|---|---|")
    for vertices in given.vertices:
        for dtype in (torch.float32, torch.float64):
            cells = row(vertices, dtype, given.cpu)
            print(f"| {vertices} | {str(dtype)[6:]} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()

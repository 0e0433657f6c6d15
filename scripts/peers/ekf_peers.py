"""Rows per second of marsyard's EKF against numba, JAX and dynamax, in one run, CPU time of whole training steps.

Usage:  cargo build --release --example filter_peer
        pip install numba jax dynamax
        taskset -c 0 python scripts/peers/ekf_peers.py [--rounds 7] [--out results.json] [--no-dynamax]

Engines take turns round by round; the ratio is the median of the rounds' ratios. All do the same step: forward run, exact
gradient, P b, S, gain, P - y y' / S, in a network of 14 inputs with biases and logistic neurons.

- `numba-f32`, `numba-f64`: the same by loops over the lower triangle of P alone, two of its rows at once, compiled for this machine with `fastmath`;
  the update of P by a row and the product P b of the next are one pass over it, and its rows begin at whole lines of the cache.
- `jax-f32`, `jax-f64`: the rank-1 form in O(s^2), one `lax.scan` under `jit`, P donated: the best that we could write in JAX.
- `dynamax`: its extended Kalman filter as a user would call it; O(s^3), since it multiplies by the transition matrix.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import time

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import jax
import jax.numpy as jnp
import numba
import numpy as np

jax.config.update("jax_enable_x64", True)

ROOT = pathlib.Path(__file__).resolve().parents[2]
INPUTS = 14
#: Hidden layers, and rows a round for each engine.
NETWORKS = {
    "16x16": {"numba": 3000, "jax-f32": 1500, "jax-f64": 800, "dynamax": 30, "marsyard": 8000},
    "32x32": {"numba": 400, "jax-f32": 200, "jax-f64": 80, "dynamax": 4, "marsyard": 1000},
    "32x32x32": {"numba": 120, "jax-f32": 60, "jax-f64": 30, "dynamax": 0, "marsyard": 300},
}
MARSYARD = {"marsyard-f32": "ekf-f32", "marsyard-f64": "ekf-f64"}
RATIOS = [("marsyard-f32", "numba-f32"), ("marsyard-f64", "numba-f64"), ("marsyard-f32", "jax-f32"), ("marsyard-f64", "jax-f64"), ("marsyard-f32", "dynamax")]


class Marsyard:
    """The Rust side, kept running and asked for so many rows at a time."""

    def __init__(self, binary):
        self.process = subprocess.Popen([binary], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def learn(self, hidden, form, rows):
        self.process.stdin.write(f"{hidden} {form} {rows}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def layers(hidden):
    sizes = [INPUTS, *map(int, hidden.split("x")), 1]
    return list(zip(sizes[:-1], sizes[1:]))


def weights(hidden):
    return sum((inputs + 1) * neurons for inputs, neurons in layers(hidden))


def forward(shapes, w, x):
    at = 0
    for inputs, neurons in shapes:
        layer = w[at : at + (inputs + 1) * neurons].reshape(neurons, inputs + 1)
        x = jax.nn.sigmoid(layer[:, :-1] @ x + layer[:, -1])
        at += (inputs + 1) * neurons
    return x[0]


def data(rows, dtype):
    random = np.random.default_rng(1)
    x = random.standard_normal((rows, INPUTS))
    d = np.where(x[:, 0] * x[:, 1] + x[:, 2] > 1.0, 0.9, 0.1)
    return jnp.asarray(x, dtype), jnp.asarray(d, dtype)


def rank_one(hidden, rows, dtype):
    """A function that learns `rows` rows and returns its CPU seconds."""
    shapes, size = layers(hidden), weights(hidden)
    slope = jax.value_and_grad(lambda w, x: forward(shapes, w, x))

    def step(state, row):
        w, p = state
        x, d = row
        y, b = slope(w, x)
        pb = p @ b
        s = b @ pb + 1.0
        return (w + pb * ((d - y) / s), p - jnp.outer(pb, pb / s)), None

    x, d = data(rows, dtype)
    w = jnp.asarray(np.random.default_rng(2).uniform(-0.35, 0.35, size), dtype)
    state = [w, jnp.eye(size, dtype=dtype) * 10.0]
    learn = jax.jit(lambda w, p, x, d: jax.lax.scan(step, (w, p), (x, d))[0], donate_argnums=(0, 1))
    # Compiled here, so that no round pays for it.
    learn = learn.lower(*state, x, d).compile()

    def run():
        before = time.process_time()
        state[:] = jax.block_until_ready(learn(*state, x, d))
        return time.process_time() - before

    run()
    run.learnt = lambda: np.asarray(state[0])
    return run


@numba.njit(fastmath=True)
def slopes(sizes, w, x, values, errors, b):
    """The output of a row; into `b` its derivatives by each weight."""
    one = w.dtype.type(1)
    values[0, : sizes[0]] = x
    at, last = 0, len(sizes) - 1
    for layer in range(last):
        inputs, neurons = sizes[layer], sizes[layer + 1]
        for neuron in range(neurons):
            total = w[at + inputs]
            for k in range(inputs):
                total += w[at + k] * values[layer, k]
            values[layer + 1, neuron] = one / (one + np.exp(-total))
            at += inputs + 1
    errors[last, 0] = 1
    for layer in range(last - 1, -1, -1):
        inputs, neurons = sizes[layer], sizes[layer + 1]
        at -= neurons * (inputs + 1)
        errors[layer, :inputs] = 0
        for neuron in range(neurons):
            y, from_ = values[layer + 1, neuron], at + neuron * (inputs + 1)
            error = errors[layer + 1, neuron] * y * (one - y)
            for k in range(inputs):
                b[from_ + k] = error * values[layer, k]
                errors[layer, k] += error * w[from_ + k]
            b[from_ + inputs] = error
    return values[last, 0]


@numba.njit(fastmath=True)
def triangle(sizes, w, p, x, d, values, errors, b, pb, last_pb):
    """Learns rows. `last_pb` is P b / sqrt(S) of the last of them, whose outer product is still to be taken off P."""
    size, one = len(w), w.dtype.type(1)
    for row in range(len(x)):
        y = slopes(sizes, w, x[row], values, errors, b)
        pb[:] = 0
        i = 0
        # Two rows of P at once read `last_pb`, b and P b once for both.
        while i + 1 < size:
            total0, total1 = w.dtype.type(0), w.dtype.type(0)
            mine0, mine1, change0, change1 = b[i], b[i + 1], last_pb[i], last_pb[i + 1]
            for j in range(i):
                entry0, entry1 = p[i, j] - change0 * last_pb[j], p[i + 1, j] - change1 * last_pb[j]
                p[i, j], p[i + 1, j] = entry0, entry1
                total0 += entry0 * b[j]
                total1 += entry1 * b[j]
                pb[j] += entry0 * mine0 + entry1 * mine1
            p[i, i] -= change0 * change0
            p[i + 1, i] -= change1 * change0
            p[i + 1, i + 1] -= change1 * change1
            pb[i] += total0 + p[i, i] * mine0 + p[i + 1, i] * mine1
            pb[i + 1] += total1 + p[i + 1, i] * mine0 + p[i + 1, i + 1] * mine1
            i += 2
        if i < size:
            total, mine, change = w.dtype.type(0), b[i], last_pb[i]
            for j in range(i):
                entry = p[i, j] - change * last_pb[j]
                p[i, j] = entry
                total += entry * b[j]
                pb[j] += entry * mine
            p[i, i] -= change * change
            pb[i] += total + p[i, i] * mine
        s = one + np.dot(b, pb)
        w += pb * ((d[row] - y) / s)
        last_pb[:] = pb / np.sqrt(s)


def aligned(rows, columns, dtype):
    """Zeros whose rows begin at whole lines of the cache, and may be longer for it."""
    line = 64 // np.dtype(dtype).itemsize
    stride = -(-columns // line) * line
    raw = np.zeros(rows * stride + line, dtype)
    first = (-raw.ctypes.data % 64) // raw.itemsize
    return raw[first : first + rows * stride].reshape(rows, stride)


def by_numba(hidden, rows, dtype):
    """A function that learns `rows` rows by loops and returns its CPU seconds."""
    sizes, size = np.array([INPUTS, *map(int, hidden.split("x")), 1]), weights(hidden)
    x, d = (np.asarray(values) for values in data(rows, dtype))
    w, p = np.random.default_rng(2).uniform(-0.35, 0.35, size).astype(dtype), aligned(size, size, dtype)
    np.fill_diagonal(p[:, :size], 10)
    scratch = [np.zeros((len(sizes), max(sizes)), dtype) for _ in range(2)] + [aligned(1, size, dtype)[0, :size] for _ in range(3)]

    def run():
        before = time.process_time()
        triangle(sizes, w, p, x, d, *scratch)
        return time.process_time() - before

    run()
    run.learnt = lambda: w
    return run


def check():
    """The loops learn the weights that JAX's products do, in either precision."""
    for dtype, most in ((np.float64, 1e-10), (np.float32, 1e-2)):
        ours, theirs = (engine("16x16", 200, dtype).learnt() for engine in (by_numba, rank_one))
        if not (ours.dtype == dtype and np.abs(ours - theirs).max() < most):
            sys.exit(f"numba and JAX learn other weights, by up to {np.abs(ours - theirs).max()} in {dtype.__name__}")


def single_precision(run):
    """The function with JAX's doubles switched off, as dynamax expects where its parameters are single."""

    def single(*arguments):
        with jax.enable_x64(False):
            return run(*arguments)

    return single


@single_precision
def by_dynamax(hidden, rows):
    from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter

    shapes, size = layers(hidden), weights(hidden)
    x, d = data(rows, jnp.float32)
    params = ParamsNLGSSM(
        initial_mean=jnp.asarray(np.random.default_rng(2).uniform(-0.35, 0.35, size), jnp.float32),
        initial_covariance=jnp.eye(size, dtype=jnp.float32) * 10.0,
        dynamics_function=lambda w, x: w,
        dynamics_covariance=jnp.zeros((size, size), jnp.float32),
        emission_function=lambda w, x: jnp.atleast_1d(forward(shapes, w, x)),
        emission_covariance=jnp.eye(1, dtype=jnp.float32),
    )
    fields = ("filtered_means",)
    learn = jax.jit(lambda d, x: extended_kalman_filter(params, d, inputs=x, output_fields=fields).filtered_means[-1])

    def run():
        before = time.process_time()
        jax.block_until_ready(learn(d[:, None], x))
        return time.process_time() - before

    run()
    return single_precision(run)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--binary", default=str(ROOT / "target/release/examples/filter_peer"))
    parser.add_argument("--no-dynamax", action="store_true")
    parser.add_argument("--networks", nargs="*", default=list(NETWORKS))
    parser.add_argument("--out", help="write the figures as JSON")
    arguments = parser.parse_args()
    check()
    marsyard = Marsyard(arguments.binary)
    report = {"jax": jax.__version__, "numba": numba.__version__, "rounds": arguments.rounds, "networks": {}}
    for hidden in arguments.networks:
        rows = NETWORKS[hidden]
        engines = {}
        for name, form in MARSYARD.items():
            marsyard.learn(hidden, form, 64)
            engines[name] = (
                rows["marsyard"],
                lambda form=form, count=rows["marsyard"]: marsyard.learn(hidden, form, count),
            )
        for name, dtype in (("numba-f32", np.float32), ("numba-f64", np.float64)):
            engines[name] = (rows["numba"], by_numba(hidden, rows["numba"], dtype))
        for name, dtype in (("jax-f32", jnp.float32), ("jax-f64", jnp.float64)):
            engines[name] = (rows[name], rank_one(hidden, rows[name], dtype))
        if rows["dynamax"] and not arguments.no_dynamax:
            engines["dynamax"] = (rows["dynamax"], by_dynamax(hidden, rows["dynamax"]))
        seconds = {name: [] for name in engines}
        for _ in range(arguments.rounds):
            for name, (count, learn) in engines.items():
                seconds[name].append(learn() / count)
        result = {"weights": weights(hidden), "rows_per_s": {}, "ratios": {}}
        for name, times in seconds.items():
            result["rows_per_s"][name] = 1.0 / float(np.median(times))
        for ours, theirs in RATIOS:
            if theirs in seconds:
                ratios = np.array(seconds[theirs]) / np.array(seconds[ours])
                result["ratios"][f"{ours} / {theirs}"] = [float(q) for q in np.quantile(ratios, (0.5, 0.0, 1.0))]
        report["networks"][hidden] = result
        print(f"{hidden}: {result['weights']} weights")
        for name, rate in result["rows_per_s"].items():
            print(f"  {name:<14} {rate:12.1f} rows/s")
        for name, (middle, low, high) in result["ratios"].items():
            print(f"  {name:<24} {middle:8.2f}   ({low:.2f} to {high:.2f})")
    marsyard.close()
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()

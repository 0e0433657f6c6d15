"""The extended Kalman filter's equations in fifty digits: the weights that a test of the filters holds marsyard's f64 to.

Usage:  pip install mpmath
        python scripts/peers/ekf_digits.py

Hewitt et al. 2017, eqs 1, 2 and 11 to 16, as they are printed: a network of 3 inputs, 4 logistic neurons and one logistic output, with biases, learns six rows one by one
from P = 10 I, without process noise and with some. All that goes in is a binary fraction, so that f64 begins with the same numbers. Prints the weights after the last row, neuron by
neuron, inputs first, as src/train/filter/tests/forms.rs has them.
"""

import mpmath
from mpmath import matrix, mpf

mpmath.mp.dps = 50
SIZES, ROWS = [3, 4, 1], 6


def network(weights, x):
    """The output, and its gradient by the weights."""
    values, layers, at = [matrix(x)], [], 0
    for before, neurons in zip(SIZES, SIZES[1:]):
        rows = [weights[at + n * (before + 1):at + (n + 1) * (before + 1)] for n in range(neurons)]
        at += neurons * (before + 1)
        layers.append(rows)
        sums = [sum(w * v for w, v in zip(row, [*values[-1], mpf(1)])) for row in rows]
        values.append(matrix([1 / (1 + mpmath.exp(-s)) for s in sums]))
    slopes, gradient = [mpf(1)], []
    for rows, before, after in reversed(list(zip(layers, values, values[1:]))):
        slopes = [slope * y * (1 - y) for slope, y in zip(slopes, after)]
        gradient = [slope * v for slope in slopes for v in [*before, mpf(1)]] + gradient
        slopes = [sum(slope * row[i] for slope, row in zip(slopes, rows)) for i in range(len(before))]
    return values[-1][0], matrix(gradient)


def learnt(q):
    size = sum((before + 1) * neurons for before, neurons in zip(SIZES, SIZES[1:]))
    weights = [mpf((7 * i) % 11 - 5) / 16 for i in range(size)]
    p = 10 * mpmath.eye(size)
    for row in range(ROWS):
        x = [mpf((3 * i + 5 * row) % 13 - 6) / 8 for i in range(SIZES[0])]
        target, r = mpf([1, 7][row % 2]) / 8, mpf([2, 1, 4][row % 3]) / 2
        p += q * mpmath.eye(size)  # Eq. (11)
        output, b = network(weights, x)
        gain = p * b / ((b.T * p * b)[0] + r)  # Eq. (13)
        p -= gain * (b.T * p)  # Eq. (14)
        weights = [w + k * (target - output) for w, k in zip(weights, gain)]  # Eq. (15)
    return weights


for q in (mpf(0), mpf(1) / 8192):
    print(f"q = {mpmath.nstr(q, 17)}\n" + "\n".join(f"    {mpmath.nstr(weight, 17, strip_zeros=False)}," for weight in learnt(q)))

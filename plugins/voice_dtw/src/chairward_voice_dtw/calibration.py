"""The fused score's weights, and how they were found: `benchmarks/ears.py fit MANIFEST` prints this table anew.

Ridge logistic regression on segments of development speakers in clean and noisy streams; negatives are unknown words,
talk and noise, and every known word against the vocabulary without it. Nothing of a speaker is in the table.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

EVIDENCE = (
    "distance / own spread",
    "distance / second word",
    "distance / mean of words",
    "all repetitions / own spread",
    "distance / other words' spread",
    "backwards / distance",
    "noise taken off: distance / own spread",
    "noise taken off: distance / second word",
    "noise taken off: distance / other words' spread",
    "noise taken off: distance / mean of words",
    "noise taken off: all repetitions / own spread",
    "free order, own / others",
    "distance / free order",
    "distance",
    "length",
    "length ratio",
    "before, under the word",
    "after, under the word",
    "peak over room",
)
PRINTS = (
    "likeness",
    "likeness - second word's",
    "likeness - mean of words'",
    "usual likeness",
    "usual likeness - second word's",
)
"""More evidence where the speech embedding is installed."""

# begin of the fitted table
PLAIN = np.array(
    [
        -0.033,
        0.026,
        -3.681,
        -0.016,
        -1.037,
        4.578,
        -1.219,
        -2.347,
        -3.087,
        -6.041,
        -1.430,
        -10.630,
        -1.182,
        0.049,
        0.242,
        1.205,
        0.647,
        0.855,
        -0.641,
    ]
)
PLAIN_BIAS = -1.504
FUSED = np.array(
    [
        0.387,
        -4.161,
        -0.987,
        -2.048,
        -1.301,
        5.827,
        0.699,
        -4.914,
        -0.531,
        -2.162,
        -1.570,
        -4.702,
        -1.762,
        3.507,
        -0.893,
        -1.081,
        0.679,
        0.855,
        0.379,
        3.163,
        -1.723,
        3.254,
        5.350,
        -0.850,
    ]
)
FUSED_BIAS = -8.936
# end of the fitted table


def score(evidence: npt.NDArray[np.float64]) -> float:
    """Log-odds that the nearest word was said; evidence with or without that of PRINTS."""
    if len(evidence) == len(EVIDENCE):
        return float(PLAIN @ evidence + PLAIN_BIAS)
    return float(FUSED @ evidence + FUSED_BIAS)


def fit(
    x: npt.NDArray[np.float64], said: npt.NDArray[np.bool_], ridge: float = 10.0
) -> tuple[npt.NDArray[np.float64], float]:
    """Ridge logistic regression by Newton's method on standardised evidence; weights and bias for raw evidence."""
    mean, scale = x.mean(axis=0), x.std(axis=0) + 1e-9
    z = np.column_stack([(x - mean) / scale, np.ones(len(x))])
    penalty = np.diag([*[ridge] * x.shape[1], 0.0])
    w = np.zeros(z.shape[1])
    for _ in range(30):
        p = 1.0 / (1.0 + np.exp(-np.clip(z @ w, -30.0, 30.0)))
        step = np.linalg.solve((z * (p * (1 - p))[:, None]).T @ z + penalty, z.T @ (said - p) - penalty @ w)
        w += step
        if np.abs(step).max() < 1e-8:
            break
    weights = w[:-1] / scale
    return weights, float(w[-1] - weights @ mean)

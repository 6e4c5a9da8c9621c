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
    "distance / free order",
    "distance / mean of words",
    "worst 150 ms / distance",
    "all repetitions / own spread",
    "free order, own / others",
    "distance / other words' spread",
    "backwards / distance",
    "distance",
    "noise taken off: distance / own spread",
    "noise taken off: distance / second word",
    "noise taken off: distance / other words' spread",
    "distance / median of templates",
    "length ratio",
    "diagonal share",
    "peak over room",
    "length",
)
WEIGHTS = np.array(
    [
        1.106,
        4.203,
        -5.885,
        -0.956,
        -4.025,
        -4.339,
        -2.037,
        -0.365,
        7.957,
        3.342,
        -0.613,
        -10.106,
        -3.925,
        -1.655,
        2.052,
        10.023,
        -1.328,
        1.328,
    ]
)
BIAS = -4.423


def score(evidence: npt.NDArray[np.float64]) -> float:
    """Log-odds that the nearest word was said."""
    return float(WEIGHTS @ evidence + BIAS)


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

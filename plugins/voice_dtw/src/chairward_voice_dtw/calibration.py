"""The fused score: log-odds that the nearest word was said, from what was measured of it.

Logistic regression on the evidence and on a few tanh units of it (what counts for much in a quiet room counts for
little in a din). The weights are in calibration.json; `benchmarks/ears.py fit MANIFEST` writes them anew, from what is
offered in clean and noisy streams of development speakers. Negatives are unknown words, talk and noise, and every known
word against the vocabulary without it. Nothing of a speaker is in the table.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]
FILE = Path(__file__).parent / "calibration.json"

EVIDENCE = (
    "distance / own spread",
    "distance / second word",
    "distance / mean of words",
    "all repetitions / own spread",
    "distance / other words' spread",
    "backwards / distance",
    "free order, own / others",
    "distance / free order",
    "distance",
    "length",
    "length ratio",
    "before, under the word",
    "after, under the word",
    "peak over room",
)
"""What is measured of every stretch; logarithms of ratios first."""
PRINTS = (
    "likeness",
    "likeness - second word's",
    "likeness - mean of words'",
    "usual likeness",
    "usual likeness - second word's",
    "phrase distance",
    "phrase distance / own spread",
    "phrase distance / second word",
    "phrase distance / mean of words",
    "usual phrase distance / own spread",
    "pitch off the person's",
    "pitch off the word's own",
    "harmonic share",
)
"""More evidence where the speech embedding is installed; of the pitch in octaves, 0 when it is not known."""
PITCH = tuple(number for number, name in enumerate(EVIDENCE + PRINTS) if name.startswith("pitch"))


@dataclass(frozen=True, slots=True)
class Score:
    """of(evidence) = bias + linear . z + out . tanh(hidden z + offset), z the evidence less its mean, by its scale."""

    mean: Numbers
    scale: Numbers
    linear: Numbers
    hidden: Numbers
    offset: Numbers
    out: Numbers
    bias: float

    def of(self, evidence: Numbers) -> Numbers:
        """Log-odds of evidence (n or rows x n)."""
        z = (evidence - self.mean) / self.scale
        return np.asarray(self.bias + z @ self.linear + np.tanh(z @ self.hidden.T + self.offset) @ self.out)


@cache
def fitted(file: Path = FILE) -> Mapping[int, Score]:
    """The scores of a file, the shipped ones if it is not named, by how much evidence they take."""
    table = json.loads(file.read_text(encoding="utf-8"))
    scores = [Score(**{key: np.asarray(value) for key, value in row.items()}) for row in table.values()]  # type: ignore[arg-type]
    return {len(score.mean): score for score in scores}


def text(scores: Mapping[str, Score]) -> str:
    """As it stands in calibration.json."""

    def row(found: Score) -> str:
        parts = [f'  "{key}": {json.dumps(np.round(value, 4).tolist())}' for key, value in asdict(found).items()]
        return "{\n" + ",\n".join(parts) + "\n }"

    return "{\n" + ",\n".join(f' "{name}": {row(found)}' for name, found in scores.items()) + "\n}\n"


def fit(x: Numbers, said: npt.NDArray[np.bool_], *, units: int = 16, ridge: float = 60.0) -> Score:
    """The weights with the greatest likelihood, less ridge / 2 of their squares, by L-BFGS from a fixed start."""
    from scipy.optimize import minimize

    mean, scale = x.mean(axis=0), x.std(axis=0) + 1e-9
    z, count, rng = (x - mean) / scale, x.shape[1], np.random.default_rng(0)
    sizes = (count, 1, units * count, units, units)
    weights = [np.zeros(count + 1), rng.normal(0.0, 0.3, units * count), np.zeros(units), rng.normal(0.0, 0.3, units)]
    penalty = ridge * np.repeat([1.0, 0.0, 1.0, 0.0, 1.0], sizes)

    def parts(w: Numbers) -> Sequence[Numbers]:
        return np.split(w, np.cumsum(sizes)[:-1])

    def loss(w: Numbers) -> tuple[float, Numbers]:
        linear, bias, hidden, offset, out = parts(w)
        inner = np.tanh(z @ hidden.reshape(units, count).T + offset)
        odds = z @ linear + bias[0] + inner @ out
        wrong = 0.5 * (1.0 + np.tanh(0.5 * odds)) - said
        back = np.outer(wrong, out) * (1.0 - inner * inner)
        slope = np.concatenate([z.T @ wrong, [wrong.sum()], (back.T @ z).ravel(), back.sum(axis=0), inner.T @ wrong])
        least = float((np.logaddexp(0.0, odds) - odds * said).sum() + 0.5 * (penalty * w * w).sum())
        return least, slope + penalty * w

    found = minimize(loss, np.concatenate(weights), jac=True, method="L-BFGS-B", options={"maxiter": 500})
    linear, bias, hidden, offset, out = parts(found.x)
    return Score(mean, scale, linear, hidden.reshape(units, count), offset, out, float(bias[0]))

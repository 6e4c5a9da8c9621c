"""Judges random cases on all cores for laws.py and laws_many.py, and writes down how many there were."""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from multiprocessing import Pool

from report import save


def judge(
    name: str,
    what: str,
    about: str | None,
    one: Callable[[int], Mapping[str, int]],
    cases: str,
    number: int,
    at_once: int = 1,
) -> None:
    """Call `one` with every at_once-th seed, and write the sums of what it counts to results/NAME.json.

    about: the text of --help. cases: what a seed is called, and number: how many are judged unless the command line
    says otherwise. What `one` raises (a broken law) ends everything.
    """
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=about, formatter_class=form)
    parser.add_argument(f"--{cases}", dest="number", type=int, default=number)
    parser.add_argument("--processes", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=60.0, help="no more cases after so long")
    options = parser.parse_args()
    begun, counts = time.monotonic(), Counter[str]()
    with Pool(options.processes) as pool:
        for judged in pool.imap_unordered(one, range(options.seed, options.seed + options.number, at_once)):
            counts.update(judged)
            if time.monotonic() - begun > 60.0 * options.minutes:
                break
    seconds = round(time.monotonic() - begun)
    result = {"what": what, **counts, "first_seed": options.seed, "seconds": seconds}
    save(name, result)
    print(json.dumps(result, indent=1))

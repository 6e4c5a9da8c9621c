"""Whatever stands in a file or on the command line: a plan or one sentence, never another exception."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import pytest
import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from chairward import profile
from chairward.plan import Plan
from chairward.profile import ProfileError

HARD = settings(deadline=None, max_examples=80)
SCALARS = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["{run}", "@eyes.manifest", "@ranger.method", "stop", "\0", "../x", "~", "~nobody/x", "chair"])
    | st.dates()
    | st.datetimes()
    | st.times()
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)


def paths(table: dict[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every key of a nested table."""
    for key, value in table.items():
        yield (*path, key)
        if isinstance(value, dict):
            yield from paths(value, (*path, key))


def changed(table: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    table = copy.deepcopy(table)
    inner = table
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return table


@pytest.fixture(scope="module")
def fuzzed(house_of_module):
    house = house_of_module
    house.chair["settings"] = {"ranger": {"window": 5}, "eyes": {"manifest": "m.csv"}}
    house.chair["choices"] = {"ranger": {"window": [3, 5]}}
    house.chair["companion"] = {"pic": {"component": "puppet", "with_drive": "wheels", "settings": {}}}
    house.chair["observer"] = {"log": {"component": "diary", "with_drive": "wheels", "settings": {"kind": "live"}}}
    house.chair["lane"]["front"]["settings"] = {"ranger": {"minimum": 20}}
    house.chair["stop_words"] = ["stop"]
    house.chair["limits"] |= {"stop_mm": 650, "commands": ["front", "stop", "help"]}
    house.chair["lane"]["front"]["pose"] = {"x_mm": 1}
    house.person |= {"limits": {"stop_mm": 700}, "settings": {"ranger": {"window": 3}}, "language": "en"}
    house.load()
    return house


def attempt(house, sets: tuple[str, ...] = ()) -> None:
    """A plan or a ProfileError of one line; everything else fails the test."""
    try:
        assert isinstance(profile.load("test", "asha", sets, house.registry, house.folder), Plan)
    except ProfileError as error:
        text = str(error)
        assert text
        assert "\n" not in text
        assert len(text) < 2000


@HARD
@given(data=st.data())
def test_any_value_at_any_key(fuzzed, data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(["chair", "person"]))
    table = getattr(fuzzed, kind)
    where = data.draw(st.sampled_from(list(paths(table))))
    extra = data.draw(st.none() | st.text(min_size=1, max_size=6))
    spoilt = changed(table, where if extra is None else (*where[:-1], extra), data.draw(VALUES))
    fuzzed.write()
    file = fuzzed.chair_file if kind == "chair" else fuzzed.person_file
    try:
        text = tomlkit.dumps(spoilt)
    except (ValueError, TypeError):  # not everything can be written as TOML
        return
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    attempt(fuzzed)


@HARD
@given(data=st.data())
def test_any_damage_to_the_text(fuzzed, data: st.DataObject) -> None:
    fuzzed.write()
    file = data.draw(st.sampled_from([fuzzed.chair_file, fuzzed.person_file]))
    good = file.read_bytes()
    start = data.draw(st.integers(0, len(good)))
    end = data.draw(st.integers(start, min(len(good), start + 30)))
    file.write_bytes(good[:start] + data.draw(st.binary(max_size=12)) + good[end:])
    attempt(fuzzed)


@HARD
@given(data=st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")))
def test_any_file(fuzzed, data: bytes) -> None:
    fuzzed.write()
    fuzzed.person_file.write_bytes(data)
    attempt(fuzzed)


KEYS = st.sampled_from(
    [
        "ranger.window",
        "limits.stop_mm",
        "eyes.manifest",
        "wheels.port",
        "bus.rnet.takeover",
        "drive",
        "language",
        "limits",
    ]
)


@HARD
@given(sets=st.lists(st.tuples(KEYS | st.text(max_size=8), st.text(max_size=12)).map("=".join) | st.text(), max_size=3))
def test_any_set(fuzzed, sets: list[str]) -> None:
    fuzzed.write()
    attempt(fuzzed, tuple(sets))


@pytest.mark.parametrize(
    "value",
    [
        "0x" + "f" * 5000,
        "9" * 5000,
        "1e999",
        "-0.0",
        "nan",
        "[" * 2000,
        "{a=" * 2000,
        "1979-05-27",
        '"\\ud800"',
        "\udcff",
    ],
)
def test_the_nastiest_values(fuzzed, value: str) -> None:
    for key in ("limits.stop_mm", "limits.lease_s", "ranger.window", "eyes.manifest", "wheels.rate", "drive"):
        fuzzed.write()
        attempt(fuzzed, (f"{key}={value}",))
        table, _, name = key.rpartition(".")
        line = f"[{table}]\n{name} = {value}\n" if table else f"{name} = {value}\n"
        fuzzed.person_file.write_bytes(line.encode("utf-8", "surrogateescape"))
        attempt(fuzzed)

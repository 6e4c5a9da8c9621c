"""docs/safety.md names rules, code, tests and results: all exist, and every rule and hazard is shown by a test."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path
from urllib.parse import unquote

import pytest

from chairward.rules import RULES

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "safety.md").read_text()
TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", PAGE)))
CODE = sorted(set(re.findall(r"`([a-z]+(?:\.[a-z_]+)*)\.([A-Za-z_]+)`", PAGE)))
RESULTS = sorted(set(re.findall(r"[`/(](benchmarks/[\w/]+\.(?:json|py))[`)#]", PAGE)))
FIGURES = re.findall(r"\[([\d,.]+)\]\(\.\./(benchmarks/results/\w+\.json)#([\w./%,]+)\)", PAGE)
TARGETS = re.findall(
    r"^\| ([^|]+) \| at (most|least) ([\d,.]+)[^|]*\| \[([\d,.]+)\][^|]*\| ([a-z*]+) \|$", PAGE, re.MULTILINE
)
HAZARDS = [line for line in PAGE.splitlines() if re.match(r"\| H\d+ \|", line)]
CLAUSES = ("7.2", "7.3", "7.4", "8.3", "8.7", "8.9", "8.11.3")
EIGHT = ("watchdog", "dead-man", "over-current", "SIGKILL", "tilt", "low battery", "CAN fault", "link loss")


@pytest.mark.parametrize(("path", "name"), TESTS, ids=lambda part: part or "-")
def test_a_named_test_exists(path: str, name: str) -> None:
    text = (ROOT / path).read_text()
    assert not name or re.search(rf"^\s*def {name}\(", text, re.MULTILINE), f"docs/safety.md: {path} has no {name}"


def test_no_link_of_the_page_is_broken() -> None:
    links = {link.partition("#")[0] for link in re.findall(r"\]\(([^):]+)\)", PAGE)}
    assert len(links) > 5
    assert [link for link in links if not (ROOT / "docs" / link).is_file()] == []


@pytest.mark.parametrize("path", RESULTS)
def test_named_evidence_exists(path: str) -> None:
    assert (ROOT / path).is_file()


@pytest.mark.parametrize(("figure", "path", "key"), FIGURES, ids=lambda part: part)
def test_a_quoted_figure_is_the_one_in_its_file(figure: str, path: str, key: str) -> None:
    found = json.loads((ROOT / path).read_text())
    for part in map(unquote, key.split("/")):
        found = found[int(part)] if isinstance(found, list) else found[part]
    said = figure.replace(",", "")
    assert float(said) == round(found, len(said.partition(".")[2])), f"docs/safety.md: {path}#{key} is {found}"


@pytest.mark.parametrize(("what", "side", "target", "figure", "verdict"), TARGETS, ids=lambda part: part[:40])
def test_a_target_that_is_missed_is_called_missed(what: str, side: str, target: str, figure: str, verdict: str) -> None:
    aim, got = (float(number.replace(",", "")) for number in (target, figure))
    kept = got <= aim if side == "most" else got >= aim
    assert verdict == ("kept" if kept else "**missed**"), f"docs/safety.md: {what}"


def test_every_line_of_the_targets_is_compared() -> None:
    section = PAGE.partition("## Targets")[2].partition("\n## ")[0]
    _, _, *rows = [line for line in section.splitlines() if line.startswith("|")]
    assert len(TARGETS) == len(rows) > 0


@pytest.mark.parametrize(("module", "name"), [pair for pair in CODE if pair[1] != "py"], ids=lambda part: part)
def test_named_code_exists(module: str, name: str) -> None:
    full = module if module.startswith("chairward") else f"chairward.{'testing.' if module == 'laws' else ''}{module}"
    found = importlib.import_module(full)
    assert hasattr(found, name) or importlib.util.find_spec(f"{full}.{name}"), f"docs/safety.md: no {full}.{name}"


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_every_rule_answers_a_hazard(rule: object) -> None:
    name = getattr(rule, "__name__", "")
    assert any(f"`rules.{name}`" in row for row in HAZARDS)


@pytest.mark.parametrize("row", HAZARDS, ids=lambda row: row.split("|")[1].strip())
def test_every_hazard_has_a_requirement_a_test_and_evidence(row: str) -> None:
    _, _, hazard, requirement, kept_by, shown_by, evidence, _ = row.split("|")
    assert all(cell.strip() for cell in (hazard, requirement, kept_by))
    assert re.search(r"`[a-z_]+\.\w+", kept_by), "names the code that keeps it"
    assert "`tests/" in shown_by
    assert "`./run test`" in evidence or "(../benchmarks/results/" in evidence


def test_hazards_are_numbered_without_a_hole() -> None:
    assert [row.split("|")[1].strip() for row in HAZARDS] == [f"H{n}" for n in range(1, len(HAZARDS) + 1)]


@pytest.mark.parametrize("row", [*CLAUSES, *EIGHT])
def test_every_clause_and_every_one_of_the_eight_has_its_row(row: str) -> None:
    assert re.search(rf"^\| {re.escape(row)}|^\| [^|]*{re.escape(row)}[^|]*\|", PAGE, re.MULTILINE)

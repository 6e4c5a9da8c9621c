"""Every small change of a module that is still a program, by the operators of cosmic-ray: what mutation.py tries."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256

ENUMS = ("Button", "Command", "Grip", "Way")
SAME_MEMBER = (
    "a member of an enum is equal only to itself, and nothing else can be there (messages are decoded by type)"
)


@dataclass(frozen=True, slots=True)
class Mutant:
    """One small change of one statement at the top level of a module (mostly: a function).

    was and now: the changed lines. statement: the whole statement with the change; text: the whole module with it.
    function: the name of the function, or "". sets: the module's constants that the changed line defines; None where it
    is neither that nor in a function's body (a class, a decorator, a default), so that only a new import shows it.
    within: first and last line of the smallest statement that is changed. never_tried: "", or why no test can notice.
    """

    module: str
    line: int
    operator: str
    was: str
    now: str
    statement: str
    text: str
    function: str
    sets: tuple[str, ...] | None
    within: tuple[int, int]
    never_tried: str

    @property
    def key(self) -> str:
        """The same for the same change of the same statement."""
        return sha256(f"{self.module}\n{self.statement}".encode()).hexdigest()[:20]


def mutants_of(module: str, source: str) -> list[Mutant]:
    """Every mutant of a module that is a program and differs in more than annotations, each once."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    tree = ast.parse(source)
    found, sets, statements, before = [], constants_of(tree), statements_of(tree), ""
    operators = [make() for make in map(get_operator, operator_names()) if not make.arguments()]
    for node in get_ast(source).children:
        statement, function = node.get_code(), node.name.value if node.type == "funcdef" else ""
        parts, done = list(ast_nodes(get_ast(statement))), {meaning(statement), ""}
        for operator in operators:
            places = [at for part in parts for at in operator.mutation_positions(part)]
            for occurrence, (start, _) in enumerate(places):
                mutated = mutate_code(statement, operator, occurrence)
                if mutated is None or (said := meaning(mutated)) in done:
                    continue
                done.add(said)
                line = before.count("\n") + start[0]
                was, now = changed(statement, mutated), changed(mutated, statement)
                text = before + mutated + source[len(before) + len(statement) :]
                name = type(operator).__name__
                why = SAME_MEMBER if same_for_every_value(statement, mutated) else ""
                within = statements.get(line, (line, line))  # a decorator belongs to none
                found.append(Mutant(module, line, name, was, now, mutated, text, function, sets.get(line), within, why))
        before += statement
    return found


def meaning(source: str) -> str:
    """The syntax tree without annotations; "" for what is no program at all."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return ""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef():
                node.returns = None
            case ast.arg():
                node.annotation = None
            case ast.AnnAssign():
                node.annotation = ast.Constant(None)
    return ast.dump(tree)


def constants_of(tree: ast.Module) -> dict[int, tuple[str, ...]]:
    """Line -> the constants that it defines for the module; none for the lines of functions' bodies."""
    lines: dict[int, tuple[str, ...]] = {}
    for statement in tree.body:
        if isinstance(statement, ast.Assign):
            names = tuple(name.id for name in ast.walk(statement.targets[0]) if isinstance(name, ast.Name))
            lines |= dict.fromkeys(range(statement.lineno, (statement.end_lineno or 0) + 1), names)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            lines |= dict.fromkeys(range(node.body[0].lineno, (node.end_lineno or 0) + 1), ())
    return lines


def statements_of(tree: ast.Module) -> dict[int, tuple[int, int]]:
    """Line -> first and last line of the innermost statement there; of one with a body, of its head."""
    found: dict[int, tuple[int, int]] = {}
    for node in ast.walk(tree):  # the outer ones come first
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            last = max(node.lineno, body[0].lineno - 1) if body else node.end_lineno or node.lineno
            found |= dict.fromkeys(range(node.lineno, last + 1), (node.lineno, last))
    return found


def same_for_every_value(statement: str, mutated: str) -> bool:
    """Whether all that differs is `is` for `==` (or the other way round) beside a member of an enum."""
    nodes = zip(ast.walk(ast.parse(statement)), ast.walk(ast.parse(mutated)), strict=False)
    compared = [(old, new) for old, new in nodes if isinstance(old, ast.Compare) and isinstance(new, ast.Compare)]
    differ = [(old, new) for old, new in compared if ast.dump(old) != ast.dump(new)]
    if len(differ) != 1:
        return False
    ((old, new),) = differ
    if len(old.ops) != 1 or {type(old.ops[0]), type(new.ops[0])} not in ({ast.Is, ast.Eq}, {ast.IsNot, ast.NotEq}):
        return False
    match old.comparators[0]:
        case ast.Attribute(value=ast.Name(id=name)):
            return name in ENUMS
    return False


def changed(text: str, other: str) -> str:
    """The lines of a text that are not in the other."""
    difference = list(unified_diff(text.splitlines(), other.splitlines(), n=0))
    return " ".join(line[1:].strip() for line in difference[2:] if line.startswith("-"))

"""`chairward chair new`: a chair file by interview."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from chairward.chair_new import Group, Question, Value, groups, interview
from chairward.cli.places import told
from chairward.doctor import Finding
from chairward.plugins import discover
from chairward.profile import ProfileError, files

app = typer.Typer(name="chair", no_args_is_help=True, help="Set up a chair.")


class NoAnswerError(ProfileError):
    """A question that nobody is there to answer."""


@dataclass(slots=True)
class Answers:
    """Answers from a file, from the defaults (yes), or from whoever sits at the terminal."""

    given: Mapping[str, Value]
    yes: bool
    keep: bool
    _used: set[str] = field(default_factory=set)

    def answer(self, question: Question) -> Value:
        """From the file; else the default; else ask."""
        if question.key in self.given and question.key not in self._used:
            self._used.add(question.key)
            return _fit(question, self.given[question.key])
        if self.yes or question.key in self.given:
            return question.default
        while True:
            said = typer.prompt(_worded(question), default=str(question.default), show_default=bool(question.default))
            try:
                return _fit(question, said)
            except ProfileError as error:
                typer.echo(f"  {error}")

    def again(self, group: Group, wrong: Sequence[Finding]) -> bool:
        """Nobody there: keep it if that was said, else give up."""
        if self.keep:
            return False
        if self.yes or any(question.key in self.given for question in group.questions):
            raise NoAnswerError(f"{wrong[0].check}: {wrong[0].what}: {wrong[0].fix}, or say --keep-untried")
        return not typer.confirm("  Keep it all the same, and put it right later?", default=False)

    def tell(self, text: str) -> None:
        """To the terminal."""
        typer.echo(text)


def _worded(question: Question) -> str:
    return f"  {question.text}{' [' + '/'.join(question.choices) + ']' if question.choices else ''}"


def _fit(question: Question, said: Any) -> Value:
    """The answer as the type of the default. Raises ProfileError."""
    text = str(said).strip()
    if question.choices and text not in question.choices:
        raise ProfileError(f"{question.key} = '{text}': choose one of {', '.join(question.choices)}")
    if isinstance(question.default, int | float):
        try:
            number = float(text)
        except ValueError:
            raise ProfileError(f"{question.key} = '{text}': a number is asked for") from None
        return int(number) if number == int(number) else number
    return text


def _fail(error: Exception) -> NoReturn:
    typer.echo(f"chairward: {told(error)}", err=True)
    raise typer.Exit(1) from None


@app.command()
def new(
    name: Annotated[str, typer.Argument(help="what the chair is called; the file is chairs/NAME.toml")],
    answers: Annotated[Path | None, typer.Option(help="a TOML file with answers; what it leaves out is asked")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="ask nothing: defaults for what was not answered")] = False,
    keep: Annotated[bool, typer.Option("--keep-untried", help="save also what does not work yet")] = False,
    profiles: Annotated[Path | None, typer.Option("--profiles", help="folder with chairs/ and people/")] = None,
    questions: Annotated[
        bool, typer.Option("--questions", help="print the questions as an answers file, and end")
    ] = False,
) -> None:
    """Ask for what a chair file needs, try each device, and write the file with comments."""
    if questions:
        for question in [question for group in groups() for question in group.questions]:
            value = f'"{question.default}"' if isinstance(question.default, str) else question.default
            typer.echo(f'"{question.key}" = {value}'.ljust(44) + f"# {question.text}")
        return
    path = files.directory(profiles) / "chairs" / f"{name}.toml"
    try:
        if not files.is_name(name):
            raise ProfileError(f"'{name}' cannot be a profile's name: use small letters, digits, - and _")
        if path.exists():
            raise ProfileError(f"{path} is there already and was not touched: choose another name")
        given = {} if answers is None else _flat(_table(answers))
        known = {question.key for group in groups() for question in group.questions}
        if unknown := sorted(given.keys() - known):
            raise ProfileError(f"{answers}: '{unknown[0]}' is no question (there are: {', '.join(sorted(known))})")
        with tempfile.TemporaryDirectory(prefix="chairward-chair-") as folder:
            text = interview(name, Answers(given, yes, keep), discover(), Path(folder), groups())
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except (OSError, ValueError) as error:
        _fail(error)
    typer.echo(f"{path}: written. Next, wheels off the ground:")
    for step in (
        "calibrate stereo",
        f"check drive --chair {name}",
        f"check timing --chair {name}",
        f"check chair --chair {name}",
    ):
        typer.echo(f"  chairward {step}")


def _table(path: Path) -> dict[str, Any]:
    """A TOML file. Raises OSError, ProfileError."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ProfileError(f"{path}: is not TOML ({error}): see `chairward chair new NAME --questions`") from None


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Value]:
    """Nested tables as dotted keys: [cameras] left = ... is cameras.left."""
    flat: dict[str, Value] = {}
    for key, value in table.items():
        flat.update(_flat(value, f"{before}{key}.") if isinstance(value, Mapping) else {f"{before}{key}": value})
    return flat

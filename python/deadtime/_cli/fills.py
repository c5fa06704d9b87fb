"""Options of a command that follow from what they fill, and their help from numpydoc texts.

A parameter of a command is an option, with its help in the docstring of the command. One that is
marked by `Fills` stands for several options: fields of a dataclass, or parameters of a function,
which have type, default, bounds and help there.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from copy import copy
from functools import wraps
from typing import Annotated, Any, TypeAlias, get_args

import typer
from typer.models import ParameterInfo

from deadtime._base.bounds import without_bounds

#: Arguments from the command line, by the names of the parameters that they are for.
Given: TypeAlias = dict[str, Any]

_SECTION = re.compile(r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=^[^\n]+\n---|\Z)", re.M | re.S)
_ENTRY = re.compile(r"^(\S.*?)(?: :.*)?\n((?: +\S.*(?:\n|\Z))+)", re.M)


class Fills:
    """Marks a parameter of a command, of type `Given`, that stands for several options.

    Parameters
    ----------
    target : callable
        A dataclass, another class or a function.
    names : str
        Parameters of the target, with spaces between. ``name=--flag`` is an option of another name.
    optional : bool
        Whether what is not given is left out, in place of the default.
    **types : type
        Types in place of those of the target. One with a `typer.Option` in it can have its own
        help.
    """

    def __init__(
        self, target: Callable[..., Any], names: str, optional: bool = False, **types: Any
    ) -> None:
        self.target, self.optional, self.types = target, optional, types
        pairs = (text.partition("=") for text in names.split())
        self.flags = {name: flag for name, _, flag in pairs}

    def options(self) -> list[inspect.Parameter]:
        """The options, as parameters of a function that typer reads."""
        parameters = inspect.signature(self.target, eval_str=True).parameters
        helps = descriptions(self.target)
        found = []
        for name, flag in self.flags.items():
            parameter = parameters[name]
            parameter = parameter.replace(annotation=self.types.get(name, parameter.annotation))
            if self.optional:
                parameter = parameter.replace(default=None)
            found.append(_option(parameter, helps.get(name), flag))
        return found


def filled(command: Callable[..., None]) -> Callable[..., None]:
    """A command with its options as typer reads them; its help is what precedes its parameters."""
    options: list[inspect.Parameter] = []
    groups: dict[str, Fills] = {}
    helps = descriptions(command)
    for name, parameter in inspect.signature(command, eval_str=True).parameters.items():
        for note in get_args(parameter.annotation):
            if isinstance(note, Fills):
                groups[name] = note
                options += note.options()
        if name not in groups:
            options.append(_option(parameter, helps.get(name)))

    @wraps(command)
    def called(**given: Any) -> None:
        for group, fills in groups.items():
            values = {name: given.pop(name) for name in fills.flags}
            left_out = [name for name in values if fills.optional and values[name] is None]
            given[group] = {name: values[name] for name in values if name not in left_out}
        command(**given)

    called.__doc__ = (inspect.getdoc(command) or "").partition("\n\nParameters\n")[0]
    called.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in options}
    return called


def _option(parameter: inspect.Parameter, text: str | None, flag: str = "") -> inspect.Parameter:
    """A parameter that typer reads; one of type bool has no ``--no-`` unless its flag has."""
    kind, bounds = without_bounds(parameter.annotation)
    notes = get_args(parameter.annotation)
    info = next((copy(note) for note in notes if isinstance(note, ParameterInfo)), None)
    if info is None:
        flag = flag or (f"--{parameter.name.replace('_', '-')}" if kind is bool else "")
        info = typer.Option(*filter(None, [flag]), min=bounds.low, max=bounds.high)
    if info.help is None:
        info.help = text
    if parameter.default is None:
        kind |= None
    return parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=Annotated[kind, info])


def descriptions(target: Callable[..., Any]) -> dict[str, str]:
    """The first paragraph on each name in the numpydoc text of a dataclass or function.

    Examples
    --------
    >>> from deadtime.links import Limits
    >>> descriptions(Limits)["max_height"]
    'Height above which a flight is aborted, m.'
    """
    found: dict[str, str] = {}
    for section in _SECTION.findall(inspect.getdoc(target) or ""):
        for names, paragraph in _ENTRY.findall(section):
            found |= dict.fromkeys(names.split(", "), " ".join(paragraph.split()))
    return found

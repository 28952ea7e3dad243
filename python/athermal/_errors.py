"""Exceptions and warnings. Their texts are those of the command line."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Diagnostic:
    """A mistake in a graph, or what is doubtful in it."""

    code: str
    """The code, which `athermal explain` explains."""
    title: str | None
    """What mistakes of this code are about."""
    severity: str
    """`error` or `warning`."""
    message: str
    """What is wrong."""
    help: str | None
    """What to do."""
    file: str | None
    """The file in which it stands."""
    line: int | None
    """The line, from 1."""
    column: int | None
    """The column, from 1."""
    span: tuple[int, int] | None
    """The bytes of the file."""


class Error(Exception):
    """What goes wrong in this package."""


class GraphError(Error, ValueError):
    """A graph has mistakes. All of them stand in `diagnostics`."""

    diagnostics: list[Diagnostic]

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.diagnostics = []

    def _take(self, facts: list[dict[str, Any]]) -> None:
        def one(of: dict[str, Any]) -> Diagnostic:
            span = of.get("span")
            return Diagnostic(**{**of, "span": tuple(span) if span else None})

        self.diagnostics = [one(of) for of in facts]


class RequestError(Error, ValueError):
    """Data or arguments are not what the model or the function takes."""


class NoColumnError(RequestError, KeyError):
    """A frame has no such column."""

    __str__ = Exception.__str__


class NoRowError(RequestError, IndexError):
    """A frame has no such row."""


class FitError(Error, ValueError):
    """Nothing could be fitted; `reasons` has why, of each node."""

    reasons: list[str]

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.reasons = []


class OutsideError(Error, OSError):
    """A file cannot be read or written."""


class NodeError(Error, RuntimeError):
    """A node failed in its code. What a node of Python raised is the cause."""


class AthermalWarning(UserWarning):
    """What is doubtful in data or in a model, but does not stop the work."""


_CLASSES = {of.__name__: of for of in (GraphError, RequestError, FitError, OutsideError, NodeError)}


def _words(text: str) -> str:
    """Options of the command line as arguments of a function."""
    return re.sub(r"`--([a-z-]+)`", lambda of: f"`{of[1].replace('-', '_')}`", text)


def made(name: str, text: str) -> Error:
    return _CLASSES[name](text if name in ("GraphError", "NodeError") else _words(text))


def warn(texts: list[str], level: int) -> None:
    for text in texts:
        warnings.warn(_words(text), AthermalWarning, stacklevel=level)

"""Nodes that are written in Python: how they are declared, found, made, and how what they know is written down."""

from __future__ import annotations

import importlib
import inspect
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, overload

_FACTS = "__athermal__"
_N = TypeVar("_N", bound=Callable[..., Any])
_DECORATED: dict[str, Any] = {}


@dataclass(frozen=True)
class Channel:
    """A channel that a node reads or gives: its name and its unit."""

    name: str
    unit: str


@dataclass(frozen=True)
class Facts:
    role: str
    outputs: tuple[str, ...] | None = None
    unit: str | None = None
    span: str | None = None
    memory: str | None = None
    endless: bool = False
    own: bool = False
    every_tick: bool = False


@overload
def feature(node: _N) -> _N: ...
@overload
def feature(
    *,
    outputs: Sequence[str] | None = None,
    unit: str | None = None,
    span: str | None = None,
    memory: str | None = None,
    own: bool = False,
    every_tick: bool = False,
) -> Callable[[_N], _N]: ...
def feature(
    node: Any = None,
    *,
    outputs: Sequence[str] | None = None,
    unit: str | None = None,
    span: str | None = None,
    memory: str | None = None,
    own: bool = False,
    every_tick: bool = False,
) -> Any:
    """Makes a class or a function a feature, for graphs with `type = "python_feature"` and `python = "module:Name"`.

    A function is given the values of its inputs, `None` where one has no new value, and gives a list of its outputs: `None` is nothing
    new, NaN that there is none. It keeps nothing. A class is made with its inputs as a list of `Channel`, and has
    `step(now, values)`, of which `now` is an instant in ns; before the first step and at each new segment it is made anew.

    `outputs` names the outputs; without it there is one for each input. `unit` is theirs, without it that of the inputs. `span` is the
    length of past time that a value summarises, and `memory` how far back the inputs reach that it depends on; a class without it is
    taken to depend on all of the past. With `own` each output is made of its own input alone. With `every_tick` it runs
    though no input is new.
    """

    def decorate(node: _N) -> _N:
        names = None if outputs is None else tuple(outputs)
        endless = inspect.isclass(node) and memory is None
        return _decorated(node, Facts("feature", names, unit, span, memory, endless, own, every_tick))

    return decorate if node is None else decorate(node)


def estimator(node: _N) -> _N:
    """Makes a class an estimator, for graphs with `type = "python_estimator"` and `python = "module:Name"`.

    It is made with the names of its regressors, and has `fit(rows, truths)`, with a list of numbers for each row, and `predict(row)`,
    which changes nothing.
    """
    return _decorated(node, Facts("estimator"))


def _decorated(node: _N, facts: Facts) -> _N:
    setattr(node, _FACTS, facts)
    _DECORATED[node.__qualname__] = _DECORATED[reference(node)] = node
    return node


def reference(node: Any) -> str:
    """How a graph names a class or function: `module:Name`."""
    return f"{node.__module__}:{node.__qualname__}"


def is_node(node: Any) -> bool:
    return hasattr(node, _FACTS) and hasattr(node, "__qualname__")


def find(python: str, role: str | None = None) -> Any:
    """The class or function of a name, which its module is imported for."""
    node = _DECORATED.get(python)
    if node is None:
        module, colon, name = python.partition(":")
        if not colon:
            raise LookupError("nothing of that name was decorated in this process; write `module:Name`")
        node = sys.modules.get(module) or importlib.import_module(module)
        for part in name.split("."):
            node = getattr(node, part)
    facts = getattr(node, _FACTS, None)
    if facts is None or role not in (None, facts.role):
        raise TypeError(f"it is not decorated with `@athermal.{role or 'feature'}`")
    return node


def facts(python: str, role: str | None) -> Facts:
    found: Facts = getattr(find(python, role), _FACTS)
    return found


class Feature:
    """A class or function at work."""

    def __init__(self, python: str, parameters: dict[str, Any], channels: list[Channel]) -> None:
        node: Any = find(python, "feature")
        self._facts: Facts = getattr(node, _FACTS)
        self._is_function = not inspect.isclass(node)
        self._made: Any = None
        if self._is_function:
            inspect.signature(node).bind([], **parameters)
            self.step: Callable[[int, list[float | None]], Any] = lambda now, values: node(values, **parameters)
        else:
            self._make: Callable[[], Any] = lambda: node(channels, **parameters)
            self._kept_out = set(inspect.signature(node).parameters)
        self.segment()
        self.outputs = [(of.name, of.unit) for of in self._outputs(channels)]

    def _outputs(self, channels: list[Channel]) -> list[Channel]:
        if hasattr(self._made, "outputs"):
            return list(self._made.outputs())
        units = dict.fromkeys(self._facts.unit or of.unit for of in channels)
        if self._facts.outputs is None:
            return [Channel(of.name, self._facts.unit or of.unit) for of in channels]
        if len(units) > 1:
            raise ValueError(f"its inputs have the units {', '.join(units)}: state that of its outputs by `unit`")
        return [Channel(name, unit) for unit in units for name in self._facts.outputs]

    def segment(self) -> None:
        if not self._is_function:
            self._made = self._make()
            self.step = self._made.step

    def snapshot(self) -> str | None:
        return None if self._is_function else _written(self._made, self._kept_out)

    def restore(self, text: str) -> None:
        self.segment()
        _restore(self._made, text)


def feature_at_work(python: str, parameters: str, channels: list[tuple[str, str]]) -> Feature:
    return Feature(python, json.loads(parameters), [Channel(*of) for of in channels])


def check(python: str, parameters: str) -> None:
    """Whether an estimator can be made with these."""
    node = find(python, "estimator")
    inspect.signature(node).bind([], **json.loads(parameters))
    for method in ("fit", "predict"):
        if not callable(getattr(node, method, None)):
            raise TypeError(f"it has no method `{method}`")


def fit(python: str, parameters: str, regressors: list[str], rows: list[list[float]], truths: list[float]) -> tuple[str, float]:
    """What an estimator learns from rows, as JSON, and its root mean square error on them."""
    node = find(python, "estimator")
    made = node(regressors, **json.loads(parameters))
    made.fit(rows, truths)
    errors = [made.predict(row) - truth for row, truth in zip(rows, truths)]
    return _written(made, set(inspect.signature(node).parameters)), math.sqrt(math.fsum(of * of for of in errors) / len(errors))


def fitted(python: str, parameters: str, regressors: list[str], state: str) -> Any:
    """An estimator as it was fitted."""
    made = find(python, "estimator")(regressors, **json.loads(parameters))
    _restore(made, state)
    return made


def _written(made: Any, kept_out: set[str]) -> str:
    """What an object knows, as JSON: what its `snapshot` gives, or its attributes without the arguments that it was made with."""
    if hasattr(made, "snapshot"):
        state = made.snapshot()
    else:
        state = {name: value for name, value in vars(made).items() if name not in kept_out}
    try:
        text = json.dumps(state)
        same = repr(json.loads(text)) == repr(state)
    except (TypeError, ValueError):
        same = False
    if not same:
        raise TypeError(
            f"what `{type(made).__qualname__}` knows is not made of dicts, lists, texts, numbers and None: keep only these in its "
            "attributes, or define `snapshot` and `restore`"
        )
    return text


def _restore(made: Any, text: str) -> None:
    state = json.loads(text)
    if hasattr(made, "restore"):
        made.restore(state)
    else:
        vars(made).update(state)

"""Nodes that are written in Python: how they are declared, found, made, and how what they know is written down."""

from __future__ import annotations

import importlib
import inspect
import json
import math
import pickle
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, overload

from athermal._errors import RequestError

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
    if not hasattr(node, "__qualname__") or not callable(node):
        raise RequestError(f"{node!r} is no class or function: arguments of `@athermal.{facts.role}` go by their names")
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


Carried = tuple[tuple[str, ...], bytes]
"""Nodes by value: their names, and they as cloudpickle writes them."""


def carried(tree: str) -> Carried | None:
    """The nodes of Python that a graph names, for a process that cannot import them; `None` where there are none, or no cloudpickle."""

    def named(of: Any) -> set[str]:
        if isinstance(of, dict):
            own = {of["python"]} if str(of.get("type", "")).startswith("python_") and isinstance(of.get("python"), str) else set()
            return own.union(*map(named, of.values()))
        return set().union(*map(named, of)) if isinstance(of, list) else set()

    names = tuple(sorted(named(json.loads(tree)))) if '"python_' in tree else ()
    pickler = _cloudpickle() if names else None
    if pickler is None:
        return None
    nodes = {name: find(name) for name in names}
    # Classes of a module go by its name, which another process may not know.
    known = pickler.list_registry_pickle_by_value()
    modules = {sys.modules[node.__module__] for node in nodes.values() if node.__module__ in sys.modules}
    added = [module for module in modules if module.__name__ not in {"__main__", *known}]
    try:
        for module in added:
            pickler.register_pickle_by_value(module)
        return names, pickler.dumps(nodes)
    finally:
        for module in added:
            pickler.unregister_pickle_by_value(module)


def _cloudpickle() -> Any:
    for name in ("cloudpickle", "pyspark.cloudpickle"):
        try:
            return importlib.import_module(f"{name}.cloudpickle")
        except ImportError:
            continue
    return None


def names_nodes(tree: str) -> bool:
    """Whether a graph names nodes of Python."""
    return '"python_feature"' in tree or '"python_estimator"' in tree


def adopt(nodes: Carried | None) -> None:
    """Takes the nodes that this process cannot find by their names."""
    missing = [name for name in nodes[0] if not _is_there(name)] if nodes else []
    if nodes and missing:
        of = pickle.loads(nodes[1])
        _DECORATED.update({name: of[name] for name in missing})


def _is_there(name: str) -> bool:
    try:
        return find(name) is not None
    except Exception:
        return False


def facts(python: str, role: str | None) -> Facts:
    found: Facts = getattr(find(python, role), _FACTS)
    return found


class Feature:
    """A class or function at work."""

    def __init__(self, python: str, parameters: str, channels: list[Channel]) -> None:
        node: Any = find(python, "feature")
        self._facts: Facts = getattr(node, _FACTS)
        self._is_function = not inspect.isclass(node)
        self._made: Any = None
        if self._is_function:
            named = json.loads(parameters)
            inspect.signature(node).bind([], **named)
            self.step: Callable[[int, list[float | None]], Any] = lambda now, values: node(values, **named)
        else:
            # Each time of their own, since an object may change what it was given.
            self._make: Callable[[], Any] = lambda: node(list(channels), **json.loads(parameters))
            self._arguments = _arguments(node, channels, parameters)
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
            self._begun = _texts_of(self._made, self._arguments)
            self.step = self._made.step

    def snapshot(self) -> str | None:
        return None if self._is_function else _written(self._made, self._arguments, self._begun)

    def restore(self, text: str) -> None:
        self.segment()
        _restore(self._made, text)


def feature_at_work(python: str, parameters: str, channels: list[tuple[str, str]]) -> Feature:
    return Feature(python, parameters, [Channel(*of) for of in channels])


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
    arguments = _arguments(node, regressors, parameters)
    made = node(list(regressors), **json.loads(parameters))
    begun = _texts_of(made, arguments)
    made.fit(rows, truths)
    errors = [made.predict(row) - truth for row, truth in zip(rows, truths)]
    return _written(made, arguments, begun), math.sqrt(math.fsum(of * of for of in errors) / len(errors))


def fitted(python: str, parameters: str, regressors: list[str], state: str) -> Any:
    """An estimator as it was fitted."""
    made = find(python, "estimator")(regressors, **json.loads(parameters))
    _restore(made, state)
    return made


def _arguments(node: Any, first: Any, parameters: str) -> dict[str, str]:
    """The arguments that an object is made with, those that are not given included, each as a text."""
    bound = inspect.signature(node).bind(list(first), **json.loads(parameters))
    bound.apply_defaults()
    return {name: repr(value) for name, value in bound.arguments.items()}


def _texts_of(made: Any, arguments: dict[str, str]) -> dict[str, str]:
    """The attributes of an object that are called as arguments are, each as a text."""
    return {name: repr(value) for name, value in getattr(made, "__dict__", {}).items() if name in arguments}


def _is_plain(value: Any) -> bool:
    try:
        return repr(json.loads(json.dumps(value))) == repr(value)
    except (TypeError, ValueError):
        return False


def _written(made: Any, arguments: dict[str, str], begun: dict[str, str]) -> str:
    """What an object knows, as JSON: what its `snapshot` gives, or its attributes without those that are the arguments that it was made
    with, or were made of them in a form that is no JSON and are still as they were when it was made."""
    if hasattr(made, "snapshot"):
        state = made.snapshot()
    else:
        state = {
            name: value
            for name, value in vars(made).items()
            if name not in arguments or repr(value) not in (arguments[name], None if _is_plain(value) else begun.get(name))
        }
    if not _is_plain(state):
        raise TypeError(
            f"what `{type(made).__qualname__}` knows is not made of dicts, lists, texts, numbers and None: keep only these in its "
            "attributes, or define `snapshot` and `restore`"
        )
    return json.dumps(state)


def _restore(made: Any, text: str) -> None:
    state = json.loads(text)
    if hasattr(made, "restore"):
        made.restore(state)
    else:
        vars(made).update(state)

"""The rules that every node keeps, for tests of nodes that are written in Python.

With pytest the fixture `athermal_conforms` is there as soon as the package is installed:

    def test_my_node_keeps_the_rules(athermal_conforms):
        athermal_conforms(MyNode, Case(parameters={"factor": 2.0}))
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from athermal import _athermal, _nodes

__all__ = ["Case", "broken_rules", "conforms"]


@dataclass(frozen=True)
class Case:
    """What a node is tried with: its arguments, what else stands in its table, and what comes to its ports.

    `inputs` gives for a port how many channels come there and their unit, and where they are to lie between two values, these:
    `{"signal": (2, "Cel", 15.0, 30.0)}`. Without it two channels in nm come to `signal`, three in K to `features`. A run has so many
    `ticks`, about `every` apart.
    """

    parameters: Mapping[str, Any] = field(default_factory=dict)
    table: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    ticks: int = 600
    every: str = "10s"


class _Tried:
    def __init__(self, node: Any, role: str, case: Case) -> None:
        of_role = {"ahead": "5min"} if role == "estimator" else {}
        table = {"python": _nodes.reference(node), "parameters": dict(case.parameters), **of_role, **case.table}
        self.table = json.dumps(table)
        self.inputs = [(port, of[0], of[1], tuple(of[2:]) or None) for port, of in case.inputs.items()]
        self.ticks = case.ticks
        self.every = case.every


def broken_rules(node: Any, *cases: Case) -> list[str]:
    """The rules that a decorated class or function breaks in any of the cases, each with what was found and what to do."""
    if not _nodes.is_node(node):
        raise TypeError(f"{node!r} is not decorated with `@athermal.feature` or `@athermal.estimator`")
    role = _nodes.facts(_nodes.reference(node), None).role
    found = [] if inspect.getdoc(node) else ["explained: it has no docstring\n  to do: say in a sentence what it computes"]
    return found + _athermal.broken_rules(role, [_Tried(node, role, case) for case in cases or (Case(),)])


def conforms(node: Any, *cases: Case) -> None:
    """Fails with all that is wrong with a node, if anything is."""
    __tracebackhide__ = True
    broken = broken_rules(node, *cases)
    if broken:
        text = "\n\n".join(broken)
        raise AssertionError(f"`{node.__qualname__}` breaks {len(broken)} of the rules that every node keeps\n\n{text}\n")

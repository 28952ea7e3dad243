"""The machines of a fleet, as Spark and Dask spread them: what a worker is asked for each, and the row that it answers."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import datetime, timezone
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from athermal import Graph, RequestError, _athermal, _nodes

RESULT = ["model", "error", "rows", "rows_hash", "scores", "unfitted", "constant", "doubts"]
"""The columns of an answer, behind that of the machine."""


class Job(NamedTuple):
    """What all machines of a fleet have in common, as it is sent to workers."""

    graph: str
    created: str
    memory: int
    nodes: _nodes.Carried | None = None

    def fit(self, machine: Any, rows: Any) -> dict[str, Any]:
        """Fits one machine on its rows, a stream of Arrow in the order of time. Why it cannot be fitted stands in the answer."""
        row: dict[str, Any] = dict.fromkeys(RESULT)
        if machine is None:
            return row | {"error": "these rows are of no machine: its name is null"}
        try:
            fit = _athermal.fit_machine(_compiled(self.graph, self.nodes)._graph, str(machine), rows, self.created, self.memory)
        except RequestError as error:
            return row | {"error": str(error)}
        summed = fit.pop("rows")
        model = fit.pop("model").encode()
        return row | fit | {"model": model, "rows": summed["rows"], "rows_hash": summed["hash"]}


@lru_cache(maxsize=4)
def _compiled(tree: str, nodes: _nodes.Carried | None) -> Graph:
    _nodes.adopt(nodes)
    return Graph._of(_athermal.Graph.of_json("graph", tree))


def job(graph: Graph | str | os.PathLike[str], date: str | None, memory: int) -> tuple[Graph, Job]:
    """The graph, and what workers are asked. `memory` is in megabytes."""
    if not isinstance(graph, Graph):
        graph = Graph(graph)
    tree = graph._graph.to_json()
    nodes = _nodes.carried(tree)
    if nodes is None and _nodes.names_nodes(tree):
        raise RequestError("the graph has nodes of Python, which go to workers by cloudpickle: install it")
    return graph, Job(tree, date or _now(), memory << 20, nodes)


def _now() -> str:
    stated = os.environ.get("SOURCE_DATE_EPOCH")
    now = datetime.fromtimestamp(int(stated), timezone.utc) if stated else datetime.now(timezone.utc)
    return now.strftime("%Y-%m-%dT%H:%M:%SZ")


def wanted(graph: Graph, by: str, time: str | None, there: Iterable[str]) -> dict[str, str]:
    """The columns that are needed of those that are there, and the names by which the graph knows them."""
    there = list(there)
    if by not in there:
        raise RequestError(f"the frame has no column `{by}` that names the machine of a row; name one by `by=`")
    known_as = {of: of for of in [by, *graph._graph.columns] if of in there}
    if time is not None:
        times = graph._graph.time_columns
        if time not in there:
            raise RequestError(f"the frame has no column `{time}`")
        if len(times) != 1:
            raise RequestError(f"time={time!r}: the graph puts its time together from {', '.join(times)}; give these columns")
        if by == times[0] != time:
            raise RequestError(f"time={time!r}: `{by}`, which names the machine, has the name of the graph's time")
        known_as.pop(times[0], None)
        known_as[time] = times[0]
    return known_as


def save(rows: Iterable[Any], folder: str | os.PathLike[str], by: str) -> dict[str, str]:
    """Writes the models of rows that were answered into a folder, each as `MACHINE.json`."""
    folder, failed = Path(folder), {}
    folder.mkdir(parents=True, exist_ok=True)
    for row in rows:
        machine, model = str(row[by]), row["model"]
        if not isinstance(model, (bytes, bytearray)):
            failed[machine] = row["error"]
        elif machine.startswith((".", "_")) or "/" in machine or "\0" in machine:
            failed[machine] = f"{machine!r} cannot be the name of a file"
        else:
            beside = folder / f".{machine}.json.new"
            beside.write_bytes(model)
            os.replace(beside, folder / f"{machine}.json")
    return failed

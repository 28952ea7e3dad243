"""Fits a graph on each machine of a fleet with Dask, where the rows are.

    fitted = athermal.dask.fit(dask.dataframe.read_parquet("logs"), "graph.toml", by="machine")
"""

from __future__ import annotations

import os
from typing import Any

from athermal import Graph, RequestError, _athermal, _fleet, _frames
from athermal._fleet import Job

__all__ = ["fit", "save"]


def fit(
    df: Any,
    graph: Graph | str | os.PathLike[str],
    by: str = "machine",
    time: str | None = None,
    *,
    date: str | None = None,
    memory: int = 64,
    partitions: int | None = None,
) -> Any:
    """Fits `graph` on the rows of each machine of `df`, a frame of Dask, and gives one with a row for each machine, which is lazy as all are.

    The arguments and the columns are those of `athermal.spark.fit`. Dask brings the rows of a machine together in one partition, which
    has several machines and must fit in the memory of a worker: `partitions` says how many there are, else as many as `df` has. Rows of a
    machine with equal times are taken in the order in which they come.

    Raises `RequestError` where columns of the graph are missing, `GraphError` where the graph has mistakes.
    """
    import pandas

    if not hasattr(df, "map_partitions"):
        raise RequestError(f"{type(df).__qualname__} is no frame of Dask: `dask.dataframe.from_pandas` makes one, and `Graph.fit` takes all others")
    graph, job = _fleet.job(graph, date, memory)
    known_as = _fleet.wanted(graph, by, time, df.columns)
    rows = df[list(known_as)].rename(columns=known_as)
    _athermal.check_columns(graph._graph, "the frame", _frames.table(rows._meta))
    times = [of for of in graph._graph.time_columns if of in known_as.values()]
    meta = {by: pandas.Series(dtype=object)}
    meta |= {of: pandas.Series(dtype="Int64" if of == "rows" else object) for of in _fleet.RESULT}
    shuffled = rows.shuffle(on=by, npartitions=partitions)
    reads_by = by in graph._graph.columns
    return shuffled.map_partitions(_fitted, job, by, times, reads_by, meta=pandas.DataFrame(meta))


def save(fitted: Any, folder: str | os.PathLike[str], by: str = "machine") -> dict[str, str]:
    """Writes the models of a fitted fleet into a folder as `athermal fleet` reads them, each as `MACHINE.json`.

    Gives the machines that have none, and why. `fitted` is a frame of Dask, or what its `compute` gave.
    """
    if hasattr(fitted, "compute"):
        fitted = fitted.compute()
    return _fleet.save(fitted.to_dict("records"), folder, by)


def _fitted(rows: Any, job: Job, by: str, times: list[str], reads_by: bool) -> Any:
    """The answers for the machines of a partition; in a worker of Dask."""
    import pandas

    answers = []
    for machine, its in rows.groupby(by, sort=True, dropna=False, observed=True):
        machine = None if pandas.isna(machine) else machine
        its = its.sort_values(times, kind="stable")
        if not reads_by:
            # Texts of a shuffle begin at any address, which not every reader of Arrow takes.
            its = its.drop(columns=by)
        answers.append({by: machine, **job.fit(machine, _frames.table(its))})
    found = pandas.DataFrame(answers, columns=[by, *_fleet.RESULT], dtype=object)
    return found.astype({"rows": "Int64"})

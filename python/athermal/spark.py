"""Fits a graph on each machine of a fleet with Spark 4.1 or later, where the rows are.

    fitted = athermal.spark.fit(spark.read.parquet("logs"), "graph.toml", by="machine")
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from athermal import Graph, RequestError, _athermal, _fleet
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
    """Fits `graph` on the rows of each machine of `df`, and gives a frame of Spark with a row for each machine, which is lazy as all are.

    `by` is the column that names the machine of a row. `time` is the one that stands for the time of the graph. `date` is the one on the
    models, as RFC 3339 writes it; else the present time. A fit keeps at most `memory` megabytes of rows; beyond that they go to a file of
    the executor. `partitions` says over how many parts the machines are spread; else `spark.sql.shuffle.partitions` does.

    The columns are `by`, `model` (the bytes of a model; null where the machine failed), `error` (why it did), `rows` and `rows_hash` (by
    which the rows are known again), `scores`, `unfitted`, `constant` and `doubts`, as the manifest of `athermal fleet fit` has them.

    Spark brings the rows of a machine together and sorts them by time on disk where need be, and hands them over in batches: a machine
    need not fit in memory. Rows of a machine with equal times have no order: the first that comes is taken and the others are not. A
    column of texts is sorted as texts are, which is the order of time for dates as ISO 8601 writes them.

    Raises `RequestError` where columns of the graph are missing, `GraphError` where the graph has mistakes.
    """
    import pyarrow
    from pyspark.sql import functions

    if not hasattr(df, "sparkSession"):
        raise RequestError(f"{type(df).__qualname__} is no frame of Spark: `createDataFrame` makes one, and `Graph.fit` takes all others")
    graph, job = _fleet.job(graph, date, memory)
    known_as = _fleet.wanted(graph, by, time, df.columns)
    rows = df.select(*(functions.col(_quoted(of)).alias(name) for of, name in known_as.items()))
    _athermal.check_columns(graph._graph, "the frame", rows.limit(0).toArrow())

    machine = functions.col(_quoted(by))
    times = [functions.col(_quoted(of)) for of in graph._graph.time_columns if of in known_as.values()]
    if partitions is None:
        # Stated, or Spark joins parts with few bytes, whose fits take long nevertheless.
        partitions = int(df.sparkSession.conf.get("spark.sql.shuffle.partitions"))

    def fitted(key: Any, batches: Any) -> Any:
        return _fitted(job, by, key, batches)

    # By these Spark knows that batches come one after the other.
    fitted.__annotations__ = {
        "key": tuple[pyarrow.Scalar, ...],
        "batches": Iterator[pyarrow.RecordBatch],
        "return": Iterator[pyarrow.RecordBatch],
    }
    # The order within a partition is kept where rows are grouped by what it begins with.
    rows = rows.repartition(partitions, machine).sortWithinPartitions(machine, *times)
    schema = f"{_quoted(by)} {rows.schema[by].dataType.simpleString()}, {_SCHEMA}"
    return rows.groupBy(machine).applyInArrow(fitted, schema)


_SCHEMA = (
    "`model` binary, `error` string, `rows` bigint, `rows_hash` string, "
    "`scores` array<struct<`of`: string, `truth`: string, `unit`: string, `n`: bigint, `rmse`: double>>, "
    "`unfitted` array<struct<`node`: string, `error`: string>>, `constant` array<string>, "
    "`doubts` array<struct<`channel`: string, `fault`: string, `count`: bigint, `text`: string>>"
)
"""The types of an answer for Spark, behind that of the machine."""


def save(fitted: Any, folder: str | os.PathLike[str], by: str = "machine") -> dict[str, str]:
    """Writes the models of a fitted fleet into a folder as `athermal fleet` reads them, each as `MACHINE.json`.

    Gives the machines that have none, and why. The driver has the models of one part at a time.
    """
    is_ours = not fitted.is_cached
    fitted = fitted.persist() if is_ours else fitted
    try:
        # All parts are fitted at a time; the iterator alone would have one fitted after the other.
        fitted.count()
        return _fleet.save(fitted.toLocalIterator(), folder, by)
    finally:
        if is_ours:
            fitted.unpersist()


def _quoted(column: str) -> str:
    return "`" + column.replace("`", "``") + "`"


def _types() -> list[Any]:
    """The same for Arrow."""
    import pyarrow as pa

    text, count, number = pa.string(), pa.int64(), pa.float64()

    def objects(**of: Any) -> Any:
        return pa.list_(pa.struct(list(of.items())))

    return [
        pa.binary(),
        text,
        count,
        text,
        objects(of=text, truth=text, unit=text, n=count, rmse=number),
        objects(node=text, error=text),
        pa.list_(text),
        objects(channel=text, fault=text, count=count, text=text),
    ]


def _fitted(job: Job, by: str, key: Any, batches: Any) -> Any:
    """The answer for one machine, as a batch; in a worker of Spark."""
    import pyarrow

    broken: list[BaseException] = []

    def watched(batches: Any) -> Any:
        try:
            yield from batches
        except BaseException as error:
            broken.append(error)
            raise

    first = next(batches)
    stream = pyarrow.RecordBatchReader.from_batches(first.schema, watched(_chained(first, batches)))
    row = job.fit(key[0].as_py(), stream)
    if broken:
        # It is not the machine that failed but Spark, which tries it again.
        raise broken[0]
    columns = [pyarrow.array([key[0].as_py()], key[0].type)]
    columns += [pyarrow.array([row[name]], of) for name, of in zip(_fleet.RESULT, _types())]
    yield pyarrow.RecordBatch.from_arrays(columns, [by, *_fleet.RESULT])


def _chained(first: Any, others: Any) -> Any:
    yield first
    del first
    yield from others

"""A fleet fitted by Spark on a cluster of two executors, of which one is killed while it fits a machine."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import DATE, MACHINES, check_doubts, check_fleet, doubtful, parts, run_blocks, with_a_node

import athermal
import athermal._fleet

pyspark = pytest.importorskip("pyspark", minversion="4.1")
pyarrow = pytest.importorskip("pyarrow")
if not (os.environ.get("JAVA_HOME") or shutil.which("java")):
    pytest.skip("Spark needs Java, which is not there", allow_module_level=True)

from pyspark import cloudpickle  # noqa: E402
from pyspark.sql import SparkSession, functions  # noqa: E402

# Executors do not find this file.
cloudpickle.register_pickle_by_value(sys.modules[__name__])


@pytest.fixture(scope="module")
def spark(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spark")
    os.environ["SPARK_HOME"] = str(Path(pyspark.__file__).parent)
    os.environ["SPARK_WORKER_DIR"] = str(folder / "work")
    os.environ["SPARK_LOCAL_IP"] = "127.0.0.1"
    os.environ["PYSPARK_PYTHON"] = sys.executable
    builder = SparkSession.builder.master("local-cluster[2,1,1024]").appName("athermal")
    settings = {
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.executorEnv.KILLED_ONCE": str(tmp_path_factory.getbasetemp() / "killed"),
        "spark.executorEnv.PYTHONPATH": str(Path(athermal.__file__).parents[1]),
        "spark.local.dir": str(folder),
        "spark.log.level": "OFF",
        "spark.sql.execution.arrow.maxRecordsPerBatch": "1000",
        "spark.sql.shuffle.partitions": "4",
        "spark.sql.warehouse.dir": str(folder / "warehouse"),
        "spark.ui.enabled": "false",
    }
    for name, value in settings.items():
        builder = builder.config(name, value)
    session = builder.getOrCreate()
    yield session
    session.stop()


class KilledOnce(athermal._fleet.Job):
    """A job whose executor is killed when it has read a part of the rows of `m2`, the first time."""

    def fit(self, machine, rows):
        if machine == "m2":
            rows = pyarrow.RecordBatchReader.from_batches(rows.schema, self.killing(rows))
        return super().fit(machine, rows)

    def killing(self, batches):
        for nth, batch in enumerate(batches):
            if nth == 3:
                kill_once(executor_of(os.getppid()))
            yield batch


def executor_of(process):
    """The executor that a process of Python works for."""
    while b"CoarseGrainedExecutorBackend" not in Path(f"/proc/{process}/cmdline").read_bytes():
        process = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    return process


def kill_once(process):
    """Kills a process, unless that was done before."""
    try:
        os.close(os.open(os.environ["KILLED_ONCE"], os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return
    os.kill(process, signal.SIGKILL)


def test_the_models_are_those_of_the_command_line_although_an_executor_is_killed(fleet, spark, monkeypatch, tmp_path, tmp_path_factory):
    monkeypatch.setattr(athermal._fleet, "Job", KilledOnce)
    # Machines and times come in any order.
    rows = spark.read.parquet(str(fleet / "logs")).orderBy(functions.rand(1))
    fitted = athermal.spark.fit(rows, fleet / "graph.toml", by="machine", date=DATE).cache()
    found = [row.asDict(recursive=True) for row in fitted.collect()]
    assert (tmp_path_factory.getbasetemp() / "killed").exists(), "no executor was killed"
    check_fleet(fleet, [row | {"model": row["model"] and bytes(row["model"])} for row in found])

    models = tmp_path / "models"
    failed = athermal.spark.save(fitted, models)
    assert list(failed) == ["m4"]
    assert sorted(path.stem for path in models.iterdir()) == MACHINES[:3]
    command = [sys.executable, "-m", "athermal", "fleet", "report", str(models), "-o", str(tmp_path / "fleet.html")]
    subprocess.run(command, check=True, cwd=tmp_path)


def test_nodes_of_python_go_to_executors_that_cannot_import_them(fleet, spark):
    tree = with_a_node(fleet)
    rows = spark.read.parquet(str(fleet / "logs" / "machine=m1")).withColumn("machine", functions.lit("m1"))
    [row] = athermal.spark.fit(rows, athermal.Graph(tree), date=DATE, partitions=1).collect()
    assert row.error is None
    assert parts(bytes(row.model).decode()) == parts(athermal.Graph(tree).fit(fleet / "logs" / "machine=m1" / "log.parquet"))


def test_a_time_of_another_name_and_type_and_a_machine_that_is_a_number_are_taken(fleet, spark):
    rows = spark.read.parquet(str(fleet / "logs" / "machine=m1"))
    at = functions.timestamp_micros((1_770_000_000_000_000 + functions.col("time_s") * 1e6).cast("long"))
    rows = rows.select(functions.lit(17).alias("unit"), at.alias("when"), *rows.columns[1:])
    fitted = athermal.spark.fit(rows, fleet / "graph.toml", by="unit", time="when", partitions=1)
    assert fitted.schema["unit"].dataType.simpleString() == "int"
    [row] = fitted.select("unit", "error", "rows").collect()
    assert (row.unit, row.error) == (17, None) and row.rows > 8000


def test_what_is_left_out_of_rows_and_times_without_a_zone_are_doubts(fleet, spark):
    tree, frame, found = doubtful(fleet)
    rows = spark.createDataFrame(frame)
    fitted = athermal.spark.fit(rows, athermal.Graph(tree), partitions=2).orderBy("machine").collect()
    check_doubts([row.asDict(recursive=True) for row in fitted], found)

    # Instants by a clock of which is not said where it stands, of seconds, in no order.
    rows = rows.filter("machine in ('naive', 'twice')").withColumn("when", functions.col("when").try_cast("timestamp_ntz"))
    assert dict(rows.dtypes)["when"] == "timestamp_ntz"
    fitted = athermal.spark.fit(rows, fleet / "graph.toml", time="when", partitions=2).orderBy("machine").collect()
    check_doubts([row.asDict(recursive=True) for row in fitted], {"naive": {"no_zone": None}, "twice": {"no_zone": None, "time_again": 1}})


def test_what_is_missing_is_refused_before_anything_is_read(fleet, spark):
    rows = spark.read.parquet(str(fleet / "logs"))
    with pytest.raises(athermal.RequestError, match="`room_degC`"):
        athermal.spark.fit(rows.drop("room_degC"), fleet / "graph.toml")
    with pytest.raises(athermal.RequestError, match="`unit`"):
        athermal.spark.fit(rows, fleet / "graph.toml", by="unit")
    with pytest.raises(athermal.RequestError, match="`when`"):
        athermal.spark.fit(rows, fleet / "graph.toml", time="when")


def test_the_blocks_of_the_documentation_run(fleet, spark, tmp_path, monkeypatch):
    (tmp_path / "graph.toml").symlink_to(fleet / "graph.toml")
    monkeypatch.chdir(tmp_path)
    run_blocks("fleet.md", "pyspark", fleet)
    assert len(list((tmp_path / "models").iterdir())) == 3

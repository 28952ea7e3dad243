"""A fleet fitted by a pool of processes, by Spark and by Dask, each with two workers, and each once more with a worker killed half-way.

    pip install athermal pyspark 'dask[dataframe,distributed]' pandas pyarrow psutil
    python benches/fleet/spread.py graphs/die-tester.toml FOLDER [MACHINES] [DAYS]

FOLDER takes the simulated rows (200 machines of 7 days: 12 million rows, 400 MB), temporary files and models. Prints the time from the
call to the last model with all that is started for it, the time of processors, the largest memory of all processes together
(proportional set size, ten times a second), and whether all models have the same bytes: those of `graph` and `fitted` also those of a
single `athermal fit`."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil

DATE = "2026-01-31T12:00:00Z"
ATHERMAL = [sys.executable, "-m", "athermal"]
# What is killed: by words of its command line.
VICTIMS = {"pool": ["fleet", "worker"], "spark": ["CoarseGrainedExecutorBackend"], "dask": ["spawn_main"]}


def simulated(folder, machines, days):
    def simulate(machine):
        its = folder / "logs" / f"machine=m{machine:03}"
        its.mkdir(parents=True, exist_ok=True)
        log = its / "log.parquet"
        if not log.exists():
            words = ["simulate", "die-tester", "--days", str(days), "--seed", str(machine), "--quiet", "-o", its / "new.parquet"]
            subprocess.run([*ATHERMAL, *map(str, words)], check=True)
            (its / "new.parquet").rename(log)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(simulate, range(1, machines + 1)))


def pool(graph, logs, models):
    words = ["fleet", "fit", graph, "--data", f"{logs}/machine=*/*.parquet", "-o", models, "--jobs", "2", "--date", DATE, "--quiet"]
    subprocess.run([*ATHERMAL, *map(str, words)], check=True)


def spark(graph, logs, models):
    import pyspark
    from pyspark.sql import SparkSession

    import athermal.spark

    os.environ["SPARK_HOME"] = str(Path(pyspark.__file__).parent)
    os.environ["SPARK_WORKER_DIR"] = f"{models}.work"
    os.environ["SPARK_LOCAL_IP"] = "127.0.0.1"
    os.environ["PYSPARK_PYTHON"] = sys.executable
    builder = SparkSession.builder.master("local-cluster[2,1,1024]")
    for name, value in {
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.local.dir": f"{models}.local",
        "spark.log.level": "OFF",
        "spark.sql.shuffle.partitions": "64",
        "spark.sql.warehouse.dir": f"{models}.warehouse",
        "spark.ui.enabled": "false",
    }.items():
        builder = builder.config(name, value)
    session = builder.getOrCreate()
    fitted = athermal.spark.fit(session.read.parquet(str(logs)), graph, by="machine", date=DATE)
    assert not athermal.spark.save(fitted, models)
    session.stop()


def dask(graph, logs, models):
    import dask
    import dask.dataframe
    import distributed

    import athermal.dask

    with (
        dask.config.set({"temporary-directory": f"{models}.local"}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster),
    ):
        rows = dask.dataframe.read_parquet(str(logs))
        fitted = athermal.dask.fit(rows, graph, by="machine", date=DATE, partitions=32)
        assert not athermal.dask.save(fitted, models)


WAYS = {"pool": pool, "spark": spark, "dask": dask}


def pss(process):
    try:
        for line in Path(f"/proc/{process.pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    except (OSError, psutil.Error):
        pass
    return 0


def measured(way, graph, folder, kill_after=None):
    """Time and that of processors in s, largest memory in MB, and the models of a way, in a process of its own."""
    models = folder / f"{way}{'' if kill_after is None else '-killed'}"
    shutil.rmtree(models, ignore_errors=True)
    began = time.perf_counter()
    child = subprocess.Popen([sys.executable, __file__, "--only", way, graph, folder / "logs", models])
    top, killed, over = 0, [], threading.Event()
    # Of each process, as long as it is there.
    used = {}

    def watch():
        nonlocal top
        root = psutil.Process(child.pid)
        while not over.wait(0.1):
            try:
                all_of_it = [root, *root.children(recursive=True)]
            except psutil.Error:
                continue
            top = max(top, sum(map(pss, all_of_it)))
            for process in all_of_it:
                try:
                    used[process.pid] = sum(process.cpu_times()[:2])
                except psutil.Error:
                    pass
            if kill_after is None or killed or time.perf_counter() - began < kill_after:
                continue
            for process in all_of_it:
                try:
                    words = " ".join(process.cmdline())
                except psutil.Error:
                    continue
                if all(of in words for of in VICTIMS[way]):
                    killed.append(process.pid)
                    os.kill(process.pid, signal.SIGKILL)
                    break

    watching = threading.Thread(target=watch)
    watching.start()
    status = child.wait()
    took = time.perf_counter() - began
    over.set()
    watching.join()
    assert status == 0, f"{way} ended with {status}"
    assert kill_after is None or killed, f"no worker of {way} was killed"
    for rest in folder.glob(f"{models.name}.*"):
        shutil.rmtree(rest, ignore_errors=True)
    found = {path.stem: path.read_bytes() for path in sorted(models.glob("[!_]*.json"))}
    shutil.rmtree(models)
    return took, sum(used.values()), top / 1e6, found


def parts(text):
    model = json.loads(text)
    return json.dumps(model["graph"]), json.dumps(model["fitted"])


def main(graph, folder, machines=200, days=7):
    folder, machines = Path(folder).absolute(), int(machines)
    simulated(folder, machines, days)
    size = sum(path.stat().st_size for path in folder.glob("logs/machine=*/*.parquet"))
    print(f"{machines} machines of {days} days, {size / 1e6:.0f} MB of Parquet, {os.cpu_count()} cores", flush=True)
    print("| way | time | of processors | memory | with a worker killed | of processors | memory | the same bytes |", flush=True)
    print("|---|---|---|---|---|---|---|---|")
    reference = None
    for way in WAYS:
        took, used, top, found = measured(way, graph, folder)
        reference = reference or found
        again, used_again, top_again, found_again = measured(way, graph, folder, kill_after=0.4 * took)
        same = len(found) == machines and found == reference and found_again == reference
        cells = [f"{took:.1f} s", f"{used:.0f} s", f"{top:.0f} MB", f"{again:.1f} s", f"{used_again:.0f} s", f"{top_again:.0f} MB"]
        # What Spark shows has no end of line.
        print(f"\r| {way} | {' | '.join(cells)} | {'yes' if same else 'NO'} |", flush=True)
    for machine in list(reference)[:2]:
        single = folder / "single.json"
        words = ["fit", graph, "--data", folder / "logs" / f"machine={machine}" / "log.parquet", "--quiet", "-o", single]
        subprocess.run([*ATHERMAL, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
        same = parts(single.read_text()) == parts(reference[machine])
        print(f"`graph` and `fitted` of machine {machine} as of a single `athermal fit`: {'yes' if same else 'NO'}")
        single.unlink()
    print("sum of all:", hashlib.sha256(b"".join(reference.values())).hexdigest()[:16])


# Workers of Dask read this file once more.
if __name__ == "__main__":
    if sys.argv[1] == "--only":
        WAYS[sys.argv[2]](*map(Path, sys.argv[3:]))
    else:
        main(*sys.argv[1:])

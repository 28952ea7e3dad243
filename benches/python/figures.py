"""What the Python package costs: memory of a fit from a frame, time of a call of an engine, and time of a fit beside the command line.

    pip install athermal pandas polars pyarrow scikit-learn river numpy
    cargo build --release --features parquet
    python benches/python/figures.py [target/release/athermal]

scikit-learn and river do the like on the same rows in the same run; all have one thread. Times are those of processors."""

import os

for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"]:
    os.environ[threads] = "1"

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROWS, COLUMNS, ROUNDS = 1_000_000, 50, 3
HERE = Path(__file__).parent
GRAPH = HERE.parents[1] / "graphs" / "die-tester.toml"
NAMES = [f"x{nth}" for nth in range(COLUMNS - 2)]

WIDE = f"""
schema = 1
[time]
column = "t"
[signals.x]
unit = "1"
channels = {json.dumps(NAMES)}
column = "{{channel}}"
max_age = "1s"
[signals.y]
unit = "1"
channels = ["y"]
column = "{{channel}}"
max_age = "1s"
[nodes.linear]
type = "linear"
inputs.features = "x"
inputs.truth = "y.y"
ahead = "0s"
[outputs]
y = "linear"
"""

THROUGH = """
schema = 1
[time]
column = "t"
[signals.x]
unit = "1"
channels = ["a", "b", "c", "d"]
column = "{channel}"
max_age = "1min"
[outputs]
x = "x"
"""

LEARNING = """
schema = 1
[time]
column = "t"
[signals.x]
unit = "1"
channels = ["a", "b", "c", "d"]
column = "{channel}"
max_age = "1min"
[signals.y]
unit = "1"
channels = ["y"]
column = "{channel}"
max_age = "1min"
[nodes.learner]
type = "rls"
inputs.features = "x"
inputs.truth = "y.y"
ahead = "0s"
[outputs]
y = "learner"
"""


def status(name):
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name + ":"):
            return int(line.split()[1]) * 1024 / 1e6


def wide():
    """A frame of numbers, and the columns as numpy has them."""
    import numpy as np

    random = np.random.default_rng(1)
    columns = {"t": np.arange(ROWS) * 0.1}
    columns |= {name: random.normal(size=ROWS) for name in NAMES}
    columns["y"] = sum(columns[name] for name in NAMES[::3]) + random.normal(size=ROWS)
    return columns


def memory(library):
    """Fits on the wide frame; prints what the frame has, how much more the process had at most, and the time."""
    import numpy as np

    columns = wide()
    if library == "scikit-learn":
        from sklearn.linear_model import Ridge
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        x, y = np.column_stack([columns[name] for name in NAMES]), columns["y"]
        del columns
        size, work = x.nbytes + y.nbytes, lambda: make_pipeline(StandardScaler(), Ridge(alpha=1.0)).fit(x, y)
    else:
        import athermal

        if library == "pyarrow":
            import pyarrow

            frame = pyarrow.table({name: pyarrow.array(of) for name, of in columns.items()})
        elif library == "polars":
            import polars

            frame = polars.DataFrame(columns)
        else:
            import pandas

            frame = pandas.DataFrame(columns)
        del columns
        graph = athermal.Graph(WIDE)
        size, work = ROWS * COLUMNS * 8, lambda: graph.fit(frame, threads=1)
    # What was the highest so far is forgotten.
    Path("/proc/self/clear_refs").write_text("5")
    before = status("VmRSS")
    start = time.process_time()
    work()
    took = time.process_time() - start
    print(json.dumps({"frame": size / 1e6, "more": status("VmHWM") - before, "time": took}))


def calls():
    """Microseconds of a call: of an engine that passes values on, of the die tester's and its rows in one go, of a learner, of river's."""
    import athermal
    from river.linear_model import BayesianLinearRegression

    def best(work, calls):
        found = []
        for nth in range(ROUNDS):
            start = time.process_time()
            work(nth)
            found.append((time.process_time() - start) / calls * 1e6)
        return min(found)

    def steps(engine, rows):
        last = rows[-1][0] + 1_000_000_000

        def work(nth):
            for at, row in moved[nth]:
                engine.step(at, row)

        moved = [[(at + nth * last, row) for at, row in rows] for nth in range(ROUNDS)]
        return best(work, len(rows))

    def of_text(text):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "graph.toml"
            path.write_text(text)
            return athermal.Model.load(path)

    def row(nth):
        return {name: float(nth % by - by // 2) for name, by in zip("abcd", (7, 5, 3, 11))}

    few = [(nth * 1_000_000_000, row(nth)) for nth in range(20_000)]
    found = {"an engine that passes on 4 channels": steps(of_text(THROUGH).engine(), few)}

    graph = athermal.Graph(GRAPH)
    week = athermal.simulate("die-tester", days=2)
    model = graph.fit(week, threads=1)
    names = [name for name in week.columns if name in graph.columns and name != "time_s"]
    columns = [week[name] for name in names]
    rows = [(round(at * 1e9), dict(zip(names, values))) for at, *values in zip(week["time_s"], *columns)]
    found["the die tester, 12 channels in and 6 out"] = steps(model.engine(), rows)
    found["the die tester's rows by `predict`"] = best(lambda _: model.predict(week), len(rows))

    learned = [(at, {**values, "y": values["a"] - values["c"]}) for at, values in few]
    frame = {"t": [at / 1e9 for at, _ in learned], **{name: [values[name] for _, values in learned] for name in [*"abcd", "y"]}}
    learner = athermal.Graph(LEARNING).fit(frame)
    found["recursive least squares of 4 regressors"] = steps(learner.engine(), learned)
    theirs = BayesianLinearRegression(smoothing=0.999)

    def river(_):
        for _, values in few:
            theirs.predict_one(values)
            theirs.learn_one(values, values["a"] - values["c"])

    found["river, Bayesian regression of 4 regressors"] = best(river, len(few))
    print(json.dumps(found))


def of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fits(path, graph, program):
    """Seconds of processors for a fit: by the command line from Parquet, from a frame of pyarrow, from one of polars; in turn, the best of all rounds."""
    import athermal
    import polars
    import pyarrow.parquet

    graph_of = athermal.Graph(graph)
    frames = {"pyarrow": pyarrow.parquet.read_table(path), "polars": polars.read_parquet(path)}
    found = {"the command line": [], **{library: [] for library in frames}}
    with tempfile.TemporaryDirectory() as folder:
        words = [*json.loads(program), "fit", graph, "--data", path, "--threads", "1", "--quiet", "-o", f"{folder}/model.json"]
        for _ in range(ROUNDS):
            start = of_children()
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
            found["the command line"].append(of_children() - start)
            for library, frame in frames.items():
                start = time.process_time()
                model = graph_of.fit(frame, threads=1)
                found[library].append(time.process_time() - start)
        of_files = json.loads(Path(f"{folder}/model.json").read_text())
    same = json.dumps(of_files["fitted"]) == json.dumps(json.loads(model.to_json())["fitted"])
    print(json.dumps({**{name: min(times) for name, times in found.items()}, "same": same}))


def main(program):
    def asked(*words):
        return json.loads(subprocess.run([sys.executable, __file__, *words], check=True, stdout=subprocess.PIPE).stdout)

    print(f"| a fit on {ROWS:,} rows of {COLUMNS} doubles | of them in the frame | more memory | time |\n|---|---|---|---|")
    for library in ["pyarrow", "polars", "pandas", "scikit-learn"]:
        of = asked("memory", library)
        print(f"| {library} | {of['frame']:.0f} MB | {of['more']:.0f} MB | {of['time']:.2f} s |", flush=True)
    print("\n| a call | time |\n|---|---|")
    for name, time_us in asked("calls").items():
        print(f"| {name} | {time_us:.2f} µs |", flush=True)
    print("\n| a fit | command line, Parquet | pyarrow | polars | the same fit |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        import pyarrow
        import pyarrow.parquet

        import athermal

        week, many, text = f"{folder}/week.parquet", f"{folder}/wide.parquet", f"{folder}/wide.toml"
        pyarrow.parquet.write_table(pyarrow.table(athermal.simulate("die-tester", days=7)), week)
        pyarrow.parquet.write_table(pyarrow.table(wide()), many)
        Path(text).write_text(WIDE)
        for name, path, graph in [("a week of the die tester", week, str(GRAPH)), (f"{ROWS:,} × {COLUMNS}", many, text)]:
            of = asked("fits", path, graph, json.dumps(program))
            line = of["the command line"]
            cells = [f"{line:.3f} s", *(f"{of[library]:.3f} s, {of[library] / line:.2f} ×" for library in ("pyarrow", "polars"))]
            print(f"| {name} | {' | '.join(cells)} | {'yes' if of['same'] else 'NO'} |", flush=True)


ASKED = {"memory": memory, "calls": calls, "fits": fits}
if sys.argv[1:] and sys.argv[1] in ASKED:
    ASKED[sys.argv[1]](*sys.argv[2:])
else:
    # Without a program, the one that the package installs.
    main(sys.argv[1:] or [sys.executable, "-m", "athermal"])

"""A small graph, the data of a simulated machine, and the command line that is installed with the package."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import athermal

GRAPH = """
schema = 1
name = "small"

[sets]
axis = ["Z1", "Z2"]

[time]
column = "time_s"

[signals.temperature]
unit = "Cel"
channels = ["plate1", "plate2", "room"]
column = "{channel}_degC"
max_age = "1min"

[signals.position]
unit = "nm"
channels = "axis"
column = "{channel}_nm"
max_age = "3min"

[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
unit = "nm/min"

[nodes.gradients]
type = "slope"
inputs.signal = "temperature"
windows = ["5min", "12min"]
unit = "mK/min"

[nodes.thermal]
type = "linear"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{axis}"
ahead = "5min"

[outputs]
predicted = "thermal"
"""


@pytest.fixture(scope="session")
def graph() -> athermal.Graph:
    return athermal.Graph(GRAPH)


@pytest.fixture(scope="session")
def week() -> athermal.Frame:
    return athermal.simulate("die-tester", days=0.5, seed=1)


@pytest.fixture(scope="session")
def columns(week: athermal.Frame) -> dict[str, list[float | None]]:
    return week.to_dict()


@pytest.fixture(scope="session")
def model(graph: athermal.Graph, week: athermal.Frame) -> athermal.Model:
    return graph.fit(week)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the graph, the same data as CSV, and the model that the command line makes of them."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "graph.toml").write_text(GRAPH)
    run(folder, "simulate", "die-tester", "--days", "0.5", "--seed", "1", "-o", "week.csv")
    run(folder, "fit", "graph.toml", "--data", "week.csv", "-o", "model.json")
    return folder


def run(folder: Path, *words: str) -> str:
    """The command line, as the package installs it."""
    command = [sys.executable, "-m", "athermal", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def parts(model: athermal.Model | str) -> tuple[str, str]:
    """What is of the graph and what was fitted, as bytes: the card names files."""
    text = model if isinstance(model, str) else model.to_json()
    read = json.loads(text)
    return json.dumps(read["graph"]), json.dumps(read["fitted"])


DATE = "2026-01-31T12:00:00Z"
MACHINES = ["m1", "m2", "m3", "m4"]


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the graph, a day of Parquet of each of four machines, and the models that the command line makes of them.

    Of `m4` no truth was measured, so that it cannot be fitted.
    """
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "graph.toml").write_text(GRAPH)
    for nth, machine in enumerate(MACHINES):
        rows = pyarrow.table(athermal.simulate("die-tester", days=1, seed=nth + 1))
        for axis in ("Z1_nm", "Z2_nm") if machine == "m4" else ():
            rows = rows.set_column(rows.column_names.index(axis), axis, pyarrow.nulls(len(rows), "f8"))
        its = folder / "logs" / f"machine={machine}"
        its.mkdir(parents=True)
        parquet.write_table(rows, its / "log.parquet", row_group_size=2000)
    words = ["fleet", "fit", "graph.toml", "--data", "logs/machine=*/*.parquet", "-o", "models", "--date", DATE]
    done = subprocess.run([sys.executable, "-m", "athermal", *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1 and "m4" in done.stderr, done.stderr
    run(folder, "fit", "graph.toml", "--data", "logs/machine=m1/log.parquet", "-o", "m1.json")
    return folder


def with_a_node(fleet: Path) -> dict[str, object]:
    """The graph of the fleet with a feature that is written in Python, in a module that is on no path of workers."""
    import nodes_of_a_user as nodes

    tree = athermal.Graph(fleet / "graph.toml").to_dict()
    tree["nodes"]["mine"] = {"type": "python_feature", "python": nodes.Difference, "inputs": {"signal": "gradients"}, "parameters": {"factor": 0.5}}
    tree["nodes"]["thermal"]["inputs"]["features"] = "mine"
    return tree


def check_fleet(fleet: Path, rows: list[dict[str, object]]) -> None:
    """The rows of a fitted fleet have the models of the command line, to the byte, and say why a machine has none."""
    assert sorted(row["machine"] for row in rows) == MACHINES
    for row in rows:
        machine, model = row["machine"], row["model"]
        if machine == "m4":
            assert model is None and "nothing could be fitted" in row["error"]
            continue
        assert model == (fleet / "models" / f"{machine}.json").read_bytes(), machine
        assert row["error"] is None and row["unfitted"] == [] and row["constant"] == []
        card = json.loads(model)["card"]
        assert [(of["rows"], of["hash"]) for of in card["data"]] == [(row["rows"], row["rows_hash"])]
        assert card["created"] == DATE
        assert [of["of"] for of in row["scores"]] == ["thermal.Z1", "thermal.Z2"]
        assert all(of["rmse"] > 0 and of["n"] > 0 and of["unit"] == "nm/min" for of in row["scores"])
        if machine == "m1":
            assert parts(model.decode()) == parts((fleet / "m1.json").read_text())


def doubtful(fleet: Path) -> tuple[dict[str, object], object, dict[str, dict[str, int | None]]]:
    """A graph of dates and a frame of pandas whose times are texts, in no order, with the faults of each machine and how often each is met.

    The clock of `back` is put back by two minutes: texts of those that come twice are not in the order of time.
    """
    import pandas

    tree = athermal.Graph(fleet / "graph.toml").to_dict()
    tree["time"] = {"column": "when", "unit": "rfc3339"}
    rows = pandas.read_parquet(fleet / "logs" / "machine=m1" / "log.parquet").iloc[:3000]
    at = pandas.to_datetime(1_792_878_000 + rows.pop("time_s").round(), unit="s").dt.floor("s")
    early = at < at[1200]
    local = (at + pandas.to_timedelta(early.map({True: 120, False: 118}), unit="min")).dt.strftime("%Y-%m-%dT%H:%M:%S")
    utc = at.dt.strftime("%Y-%m-%dT%H:%M:%SZ")
    again = rows.iloc[[700]].assign(room_degC=21.0)
    # The row of a text is left out where its instant is not after that of a row before it.
    latest, before, same = at[0], 0, 0
    back = local + early.map({True: "+02:00", False: "+01:58"})
    for _, instant in sorted(zip(back, at))[1:]:
        before, same, latest = before + (instant < latest), same + (instant == latest), max(instant, latest)
    assert before > 5 and same == 0
    machines = {
        "back": rows.assign(when=back),
        "naive": rows.assign(when=utc.str.removesuffix("Z")),
        "twice": pandas.concat([rows.assign(when=utc), again.assign(when=utc[700])]),
        "well": rows.assign(when=utc),
    }
    frame = pandas.concat([its.assign(machine=of) for of, its in machines.items()])
    found = {"back": {"time_before": before}, "naive": {"no_zone": None}, "twice": {"time_again": 1}, "well": {}}
    return tree, frame.sample(frac=1, random_state=1, ignore_index=True), found


def check_doubts(rows: list[dict[str, object]], found: dict[str, dict[str, int | None]]) -> None:
    """Machines have these doubts, each with its text and its count, and no others about their times."""
    assert [(row["machine"], row["error"]) for row in rows] == [(of, None) for of in found]
    words = {"time_before": "out of order", "time_again": "row before", "no_zone": "zone"}
    for row in rows:
        its = [of for of in row["doubts"] if of["channel"] is None]
        assert {of["fault"]: of["count"] for of in its} == found[row["machine"]], row
        assert all(words[of["fault"]] in of["text"] and row["machine"] in of["text"] for of in its), its


def run_blocks(page: str, word: str, folder: Path) -> None:
    """Runs the blocks of Python on a page of the documentation that have a word in them, with `logs` of a folder."""
    path = Path(__file__).parents[2] / "docs" / "src" / page
    if not path.is_file():
        pytest.skip("the documentation is not there")
    blocks = re.findall(r"^```python\n(.*?)^```$", path.read_text(), re.DOTALL | re.MULTILINE)
    blocks = [block for block in blocks if word in block]
    assert blocks
    for block in blocks:
        # The present folder is not that of whoever reads in another process.
        block = block.replace('"logs"', repr(str(folder / "logs")))
        exec(compile(block, str(path), "exec"), {})

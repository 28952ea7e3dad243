"""A small graph, the data of a simulated machine, and the command line that is installed with the package."""

from __future__ import annotations

import json
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

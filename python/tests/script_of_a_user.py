"""What a user writes, for `mypy --strict`: it is checked with the package as it is installed, and run by a test."""

from __future__ import annotations

import pickle
import sys
from datetime import datetime, timedelta, timezone
from pathlib import Path

import athermal
from athermal.sklearn import GraphRegressor


def rows(frame: athermal.Frame) -> list[dict[str, float | None]]:
    """The first rows."""
    return [row for row in frame[:10]]


def show(what: str, done: int, total: int | None) -> None:
    print(what, done, total, file=sys.stderr)


@athermal.feature(outputs=["spread"], unit="K")
def spread(values: list[float | None]) -> list[float | None]:
    """The warmest place less the coldest."""
    there = [value for value in values if value is not None]
    return [max(there) - min(there) if len(there) > 1 else None]


def main(folder: Path) -> float:
    week: athermal.Frame = athermal.simulate("die-tester", days=0.3, seed=1, faults=["temperature.room=missing,from=1h,for=10min"])
    starter: athermal.Starter = athermal.init(week, drifts=["Z1_nm", "Z2_nm"])
    (folder / "graph.toml").write_text(starter.text)
    graph = athermal.Graph(folder / "graph.toml")
    try:
        model: athermal.Model = graph.fit(week, lenient=True, threads=1, memory=16, progress=show)
    except athermal.FitError as error:
        print(error.reasons)
        return 0.0
    model.save(folder / "model.json")
    scores: athermal.Scores = athermal.evaluate(model, week, mode="k-step", steps=2, abs_truth_below="250 nm/min")
    diagnosis: athermal.Diagnosis = athermal.diagnose(model, week, of="Z1", no_fit=True)
    print(scores, diagnosis, athermal.compare({"starter": graph}, data=week, on=week, frozen=True))
    engine: athermal.Engine = pickle.loads(pickle.dumps(model.engine()))
    at = datetime(2026, 3, 2, tzinfo=timezone.utc)
    for nth, row in enumerate(rows(week)):
        given = engine.step(at + timedelta(seconds=10 * nth), {name: of for name, of in row.items() if name in graph.columns[1:]})
        print({name: value for name, value in given.items() if value is not None})
    column: list[float | None] = week["Z1_nm"]
    print(len(column), week[0]["time_s"], week[["time_s", "room_degC"]].columns)
    regressor = GraphRegressor(graph, target=graph.outputs[0], options={"threads": 1}).fit(week)
    return regressor.score(week)


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))

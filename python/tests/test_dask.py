"""A fleet fitted by Dask on two processes, of which one is killed while it fits a machine."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest
from conftest import DATE, check_doubts, check_fleet, doubtful, parts, run_blocks, with_a_node

import athermal
import athermal._fleet

pytest.importorskip("dask.dataframe")
distributed = pytest.importorskip("distributed")
pandas = pytest.importorskip("pandas")

import cloudpickle  # noqa: E402
import dask  # noqa: E402
import dask.dataframe  # noqa: E402

# Workers do not find this file.
cloudpickle.register_pickle_by_value(sys.modules[__name__])


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dask")
    # What workers begin with.
    os.environ["KILLED_ONCE"] = str(folder / "killed")
    path = os.pathsep.join([str(Path(athermal.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    with (
        dask.config.set({"temporary-directory": str(folder), "distributed.nanny.environ.PYTHONPATH": path}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


class KilledOnce(athermal._fleet.Job):
    """A job whose worker is killed at `m2`, the first time."""

    def fit(self, machine, rows):
        if machine == "m2":
            try:
                os.close(os.open(os.environ["KILLED_ONCE"], os.O_CREAT | os.O_EXCL))
            except FileExistsError:
                pass
            else:
                os.kill(os.getpid(), signal.SIGKILL)
        return super().fit(machine, rows)


def test_the_models_are_those_of_the_command_line_although_a_worker_is_killed(fleet, client, monkeypatch, tmp_path):
    monkeypatch.setattr(athermal._fleet, "Job", KilledOnce)
    rows = dask.dataframe.read_parquet(str(fleet / "logs"))
    # Times come in any order, and the rows of a machine are in all parts.
    rows = rows.assign(nth=rows["time_s"] % 7).set_index("nth").repartition(npartitions=3)
    fitted = athermal.dask.fit(rows, fleet / "graph.toml", by="machine", date=DATE)
    fitted = fitted.compute()
    found = fitted.to_dict("records")
    assert Path(os.environ["KILLED_ONCE"]).exists(), "no worker was killed"
    check_fleet(fleet, found)
    assert list(athermal.dask.save(fitted, tmp_path / "models")) == ["m4"]


def test_nodes_of_python_go_to_workers_that_cannot_import_them(fleet, client):
    tree = with_a_node(fleet)
    rows = dask.dataframe.read_parquet(str(fleet / "logs" / "machine=m1")).assign(machine="m1")
    [fitted] = athermal.dask.fit(rows, athermal.Graph(tree), date=DATE).compute().to_dict("records")
    assert fitted["error"] is None
    assert parts(fitted["model"].decode()) == parts(athermal.Graph(tree).fit(fleet / "logs" / "machine=m1" / "log.parquet"))
    # A graph, a model and an engine go there by themselves, too.
    model = athermal.Model.from_json(fitted["model"].decode())
    row = {"temperature.room": 20.0}
    there = client.submit(lambda graph, model, engine: (graph.outputs, model.revision, engine.step(2, row)), model.graph, model, model.engine())
    assert there.result() == (model.graph.outputs, model.revision, model.engine().step(2, row))


def test_rows_without_a_machine_and_other_names_are_taken(fleet, client):
    rows = pandas.read_parquet(fleet / "logs" / "machine=m1" / "log.parquet")
    rows["unit"] = [None if nth < 100 else 17 for nth in range(len(rows))]
    rows = rows.rename(columns={"time_s": "when"})
    rows = dask.dataframe.from_pandas(rows, npartitions=2)
    found = athermal.dask.fit(rows, fleet / "graph.toml", by="unit", time="when", partitions=1).compute()
    assert found["error"].tolist() == [None, "these rows are of no machine: its name is null"]
    assert found["rows"].tolist()[0] == len(rows) - 100


def test_what_is_left_out_of_rows_and_times_without_a_zone_are_doubts(fleet, client):
    tree, frame, found = doubtful(fleet)
    rows = dask.dataframe.from_pandas(frame, npartitions=3)
    fitted = athermal.dask.fit(rows, athermal.Graph(tree)).compute().sort_values("machine")
    check_doubts(fitted.to_dict("records"), found)

    # Instants by a clock of which is not said where it stands, of seconds, in no order.
    frame = frame[frame["machine"].isin(["naive", "twice"])]
    frame = frame.assign(when=pandas.to_datetime(frame["when"].str.removesuffix("Z")))
    rows = dask.dataframe.from_pandas(frame, npartitions=3)
    fitted = athermal.dask.fit(rows, fleet / "graph.toml", time="when").compute().sort_values("machine")
    check_doubts(fitted.to_dict("records"), {"naive": {"no_zone": None}, "twice": {"no_zone": None, "time_again": 1}})


def test_what_is_missing_is_refused_before_anything_is_read(fleet, client):
    rows = dask.dataframe.read_parquet(str(fleet / "logs"))
    with pytest.raises(athermal.RequestError, match="`room_degC`"):
        athermal.dask.fit(rows.drop(columns=["room_degC"]), fleet / "graph.toml")
    with pytest.raises(athermal.RequestError, match="`unit`"):
        athermal.dask.fit(rows, fleet / "graph.toml", by="unit")


def test_the_blocks_of_the_documentation_run(fleet, client, tmp_path, monkeypatch):
    (tmp_path / "graph.toml").symlink_to(fleet / "graph.toml")
    monkeypatch.chdir(tmp_path)
    run_blocks("fleet.md", "dask.dataframe", fleet)
    assert len(list((tmp_path / "models").iterdir())) == 3

"""Graphs, models, engines and what is found out about them."""

from __future__ import annotations

import json
import pickle
import signal
import subprocess
import sys
import threading
import time
from datetime import datetime, timezone

import pytest

import athermal
from conftest import GRAPH, parts, run


def test_a_mistake_in_a_graph_is_an_exception_with_the_text_of_the_command_line(tmp_path):
    (tmp_path / "graph.toml").write_text(GRAPH.replace("windows = [\"5min\"]", "window = [\"5min\"]"))
    command = [sys.executable, "-m", "athermal", "check", "graph.toml"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True).stderr
    with pytest.raises(athermal.GraphError) as error:
        athermal.Graph((tmp_path / "graph.toml").read_text())
    assert str(error.value) in said
    first = error.value.diagnostics[0]
    assert first.code.startswith("A") and first.title and first.message.split(" (")[0] in str(error.value)
    text = (tmp_path / "graph.toml").read_text().encode()
    assert text[slice(*first.span)].decode().strip().startswith("window")
    assert text.splitlines()[first.line - 1].decode().startswith("window")
    assert isinstance(error.value, ValueError)


def test_a_graph_is_the_same_from_a_file_a_text_and_a_dict(graph, files):
    assert athermal.Graph(files / "graph.toml") == graph
    assert athermal.Graph(graph.to_dict()) == graph
    assert athermal.Graph(str(files / "graph.toml")).outputs == ["predicted.Z1", "predicted.Z2"]
    with pytest.raises(athermal.GraphError):
        athermal.Graph(files / "none.toml")


def test_a_model_is_written_and_read_as_the_command_line_does(model, files, tmp_path):
    model.save(tmp_path / "model.json")
    assert (tmp_path / "model.json").read_text() == model.to_json()
    assert athermal.Model.load(tmp_path / "model.json") == model
    assert athermal.Model.from_json(model.to_json()) == model
    of_files = athermal.Model.load(files / "model.json")
    assert of_files.to_json() == (files / "model.json").read_text()
    assert of_files.graph == model.graph
    with pytest.raises(athermal.RequestError, match="is no model"):
        athermal.Model.from_json("{}")


def test_graphs_and_models_are_pickled(graph, model):
    assert pickle.loads(pickle.dumps(graph)) == graph
    again = pickle.loads(pickle.dumps(model))
    assert again == model and again.revision == model.revision
    assert str(again.report) == str(model.report)


def test_an_engine_steps_to_the_bits_of_predict(model, columns):
    predicted = model.predict(columns)
    engine = model.engine()
    assert engine.outputs == predicted.columns[1:]
    for nth, at in enumerate(columns["time_s"][:400]):
        row = {name: of[nth] for name, of in columns.items() if name in model.graph.columns and name != "time_s"}
        given = engine.step(round(at * 1e9), row)
        assert given == {name: predicted[name][nth] for name in engine.outputs}
        if nth == 200:
            kept = engine.snapshot()
            other = model.engine()
            other.restore(kept)
        elif nth > 200:
            assert other.step(round(at * 1e9), row) == given
    assert any(value is not None for value in given.values())
    assert engine.last_ns == round(at * 1e9)


def test_an_engine_refuses_what_it_cannot_take(model):
    engine = model.engine()
    engine.step(10, {"temperature.room": 21.0, "room_degC": None})
    with pytest.raises(athermal.RequestError, match="not after"):
        engine.step(10, {})
    with pytest.raises(KeyError, match="temperature.room"):
        engine.step(20, {"temperature.rom": 21.0})
    with pytest.raises(TypeError):
        engine.step(20, {"temperature.room": "warm"})
    with pytest.raises(TypeError, match="nanoseconds"):
        engine.step(0.5, {})
    with pytest.raises(athermal.RequestError):
        engine.restore(b"nothing")
    at = datetime(2026, 3, 2, tzinfo=timezone.utc)
    engine.step(at, {})
    assert engine.last_ns == int(at.timestamp()) * 10**9


def test_scores_are_those_of_the_command_line(model, files, week):
    said = json.loads(run(files, "evaluate", "model.json", "--data", "week.csv", "--format", "json"))
    with pytest.warns(athermal.AthermalWarning):
        import warnings

        warnings.warn("the same hours", athermal.AthermalWarning)
        scores = athermal.evaluate(model, week)
    assert scores.scores == said["scores"]
    table = run(files, "evaluate", "model.json", "--data", "week.csv")
    assert str(scores) == table
    assert "<table" in scores._repr_html_() and "<script" not in scores._repr_html_()


def test_options_are_those_of_the_command_line(model, files, week):
    said = json.loads(
        run(files, "evaluate", "model.json", "--data", "week.csv", "--abs-truth-below", "9 nm/min", "--frozen", "--format", "json")
    )
    assert athermal.evaluate(model, week, abs_truth_below="9 nm/min", frozen=True).scores == said["scores"]
    with pytest.raises(athermal.RequestError, match="k-step.*`steps=3`"):
        athermal.evaluate(model, week, mode="k-step")
    with pytest.raises(TypeError, match="nonsense"):
        athermal.evaluate(model, week, nonsense=1)


def test_diagnosis_report_and_comparison_are_those_of_the_command_line(model, graph, files, week, tmp_path):
    said = json.loads(run(files, "diagnose", "model.json", "--data", "week.csv", "--no-fit", "--format", "json"))
    found = athermal.diagnose(model, week, no_fit=True)
    assert found.diagnosis == said["diagnosis"]
    said = json.loads(run(files, "report", "model.json", "--data", "week.csv", "--format", "json"))
    page = athermal.report(model, week)
    assert page["verdicts"] == said["verdicts"]
    page.save(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text().startswith("<!")
    assert "sandbox" in page._repr_html_() and "<script" not in page._repr_html_()
    said = run(files, "compare", "graph.toml", "--data", "week.csv", "--on", "week.csv", "--format", "json")
    compared = athermal.compare(graph, week, week)
    rmse = lambda of: [row["rmse"] for table in of["comparisons"] for row in table["rows"]]
    assert rmse(compared) == rmse(json.loads(said))


def test_a_starter_graph_is_that_of_the_command_line(columns, files):
    run(files, "init", "week.csv", "-o", "starter.toml", "--force")
    starter = athermal.init(columns)
    lines = lambda text: [line for line in text.splitlines() if "week.csv" not in line and "frame" not in line and not line.startswith("name = ")]
    assert lines(starter.text) == lines((files / "starter.toml").read_text())
    assert starter.remarks and starter.fit(columns).report.estimators


def test_a_simulation_is_that_of_the_command_line(files, columns):
    import csv

    with (files / "week.csv").open() as file:
        rows = list(csv.reader(file))
    of_file = {name: [float(row[nth]) if row[nth] else None for row in rows[1:]] for nth, name in enumerate(rows[0])}
    assert of_file == columns
    with pytest.raises(athermal.RequestError, match="die-tester"):
        athermal.simulate("die-testr")
    faulty = athermal.simulate("die-tester", days=0.05, faults=["temperature.room=missing"])
    assert set(faulty["room_degC"]) == {None}


def test_a_notebook_sees_pictures_and_tables_without_scripts(graph, model):
    assert graph._repr_html_().startswith("<svg")
    shown = model._repr_html_()
    assert "<table" in shown and "<svg" in shown and "<script" not in shown
    assert all(of["rows"] > 0 for of in model.report.scores)
    assert {of["node"] for of in model.coefficients} == {"thermal.Z1", "thermal.Z2"}


def test_a_report_names_what_was_chosen(week):
    model = athermal.Graph(GRAPH.replace('type = "linear"', 'type = "linear"\nselection = { method = "forward" }')).fit(week)
    chosen = model.report.chosen["thermal.Z1"]
    assert chosen and all(name.startswith("gradients.") for name in chosen)
    assert model.report.scores[0]["r2"] > 0 and chosen[0] in model._repr_html_()


def test_progress_is_reported_and_may_end_the_work(graph, week):
    seen = []
    graph.fit(week, progress=lambda what, done, total: seen.append((what, done, total)))
    assert seen and all(what.startswith("fitting") for what, _, _ in seen)

    class Enough(Exception):
        pass

    def stop(what, done, total):
        raise Enough

    with pytest.raises(Enough):
        graph.fit(week, progress=stop)


def test_other_threads_run_while_a_model_is_fitted(graph):
    data = athermal.simulate("die-tester", days=2)
    ticks, ended = [], threading.Event()

    def count():
        while not ended.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    began = time.perf_counter()
    graph.fit(data)
    took = time.perf_counter() - began
    ended.set()
    thread.join()
    during = [at for at in ticks if began < at < began + took]
    longest = max((b - a for a, b in zip(during, during[1:])), default=took)
    assert longest < 0.5 * took, (longest, took)


JOBS = {
    "fit": "graph.fit([data] * 200)",
    "predict": "model.predict([data] * 200)",
    "evaluate": "athermal.evaluate(model, [data] * 200)",
    "diagnose": "athermal.diagnose(model, [data] * 20)",
    "report": "athermal.report(model, [data] * 40)",
    "compare": "athermal.compare(graph, [data] * 200, data)",
    "simulate": "athermal.simulate('die-tester', days=3000)",
}


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_ends_every_job_within_a_second(tmp_path):
    program = tmp_path / "long.py"
    program.write_text(
        "import athermal, os, signal, sys, warnings\n"
        "warnings.simplefilter('ignore')\n"
        # A shell that starts tests in the background has it ignored.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"graph = athermal.Graph({GRAPH!r})\n"
        "data = athermal.simulate('die-tester', days=1)\n"
        "model = graph.fit(data)\n"
        f"for job in {list(JOBS.values())!r}:\n"
        "    print('ready', flush=True)\n"
        "    try:\n"
        "        eval(job)\n"
        "        print('done', flush=True)\n"
        "    except KeyboardInterrupt:\n"
        "        print('interrupted', flush=True)\n"
        # What was left behind is not waited for.
        "os._exit(0)\n"
    )
    running = subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, text=True)
    for job in JOBS:
        assert running.stdout.readline() == "ready\n"
        time.sleep(0.3)
        running.send_signal(signal.SIGINT)
        began = time.monotonic()
        assert running.stdout.readline() == "interrupted\n", job
        assert time.monotonic() - began < 1, job
    assert running.wait(timeout=60) == 0


def test_progress_comes_to_an_end_in_every_job(graph, model, week, capsys):
    def jobs(progress):
        yield lambda: graph.fit(week, progress=progress)
        yield lambda: model.predict(week, progress=progress)
        yield lambda: athermal.evaluate(model, week, progress=progress)
        yield lambda: athermal.compare(graph, week, week, progress=progress)
        yield lambda: athermal.simulate("die-tester", days=0.3, progress=progress)

    seen = []
    for job in jobs(lambda *event: seen.append(event)):
        seen.clear()
        job()
        what, done, total = seen[-1]
        assert what and done == total > 0, seen
    for job in jobs(True):
        job()
        shown = capsys.readouterr().err
        assert shown.startswith("\r") and shown.endswith("\n") and " of " not in shown.rpartition("\r")[2], shown

    with pytest.raises(athermal.RequestError):
        graph.fit([week] + [{**week.to_dict(), "room_degC": ["broken"] * len(week)}], progress=True)
    shown = capsys.readouterr().err
    assert not shown or shown.endswith("\n"), shown


def test_what_is_no_model_graph_or_frame_is_refused_in_words(graph, model, week, tmp_path):
    (tmp_path / "model.json").write_text(model.to_json())
    path = str(tmp_path / "model.json")
    refused = {
        "athermal.Model.load": [
            lambda: athermal.evaluate(path, week),
            lambda: athermal.diagnose(None, week),
            lambda: athermal.report(7, week),
            lambda: athermal.plot(path, week),
            lambda: athermal.Engine(path),
        ],
        "graph.fit": [lambda: athermal.evaluate(graph, week), lambda: athermal.report(graph, week), lambda: athermal.Engine(graph)],
        "which is no graph": [
            lambda: athermal.compare("graph.toml", week, week),
            lambda: athermal.compare([graph, path], week, week),
            lambda: athermal.compare({"a": model}, week, week),
        ],
        "no class or function": [lambda: athermal.feature("spread"), lambda: athermal.estimator(7)],
        "there is no row": [lambda: week[10**6]],
        "found": [lambda: model.predict({}), lambda: graph.fit({"a": [1.0]})],
    }
    for words, calls in refused.items():
        for call in calls:
            with pytest.raises(athermal.RequestError, match=words):
                call()
    empty = week[:0]
    assert len(model.predict(empty)) == 0
    pyarrow = pytest.importorskip("pyarrow")
    batch = pyarrow.RecordBatch.from_arrays([pyarrow.array([], "f8") for _ in graph.columns], graph.columns)
    answer = model.predict(batch)
    assert isinstance(answer, pyarrow.RecordBatch) and answer.num_rows == 0
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("dask.dataframe")
    for module, kind in [(athermal.dask, "Dask"), (athermal.spark, "Spark")]:
        if kind == "Spark":
            pytest.importorskip("pyspark")
        for what in (None, pandas.DataFrame()):
            with pytest.raises(athermal.RequestError, match=f"is no frame of {kind}"):
                module.fit(what, graph)


def test_options_are_named_arguments_with_types_and_words(graph, model):
    import inspect

    jobs = {
        "fit": graph.fit,
        "predict": model.predict,
        "evaluate": athermal.evaluate,
        "diagnose": athermal.diagnose,
        "report": athermal.report,
        "compare": athermal.compare,
        "init": athermal.init,
        "simulate": athermal.simulate,
    }
    for name, options in json.loads(athermal._athermal.options()).items():
        signature = inspect.signature(jobs[name])
        assert all(of.kind is not inspect.Parameter.VAR_KEYWORD and of.annotation for of in signature.parameters.values())
        for option in set(options["properties"]) - {"data", "fault", "from"}:
            assert option in signature.parameters, (name, option)
            assert f"{option}:" in jobs[name].__doc__ or option in ("on", "time", "machine", "days", "seed"), (name, option)
    assert "from_" in inspect.signature(graph.fit).parameters
    # They do something.
    some = athermal.simulate("die-tester", days=0.2)
    assert len(model.predict(some, from_="3600", to="7200")) == 360


def test_an_engine_is_pickled_as_its_snapshot(model, columns):
    def row(nth):
        return {name: of[nth] for name, of in columns.items() if name in model.graph.columns and name != "time_s"}

    engine = model.engine()
    for nth in range(200):
        engine.step(nth * 10**10, row(nth))
    again = pickle.loads(pickle.dumps(engine))
    assert again.last_ns == engine.last_ns and again.outputs == engine.outputs
    for nth in range(200, 260):
        expected = engine.step(nth * 10**10, row(nth))
        assert again.step(nth * 10**10, row(nth)) == expected
    assert any(value is not None for value in expected.values())


def test_what_cannot_be_fitted_says_why(graph):
    few = {name: [0.0, 1.0] if name == "time_s" else [1.0, 1.0] for name in graph.columns}
    with pytest.raises(athermal.FitError) as error:
        graph.fit(few)
    assert any("thermal.Z1" in reason for reason in error.value.reasons)


def test_the_command_line_comes_with_the_package(tmp_path):
    assert run(tmp_path, "--version").split()[:2] == ["athermal", athermal.__version__]
    wrong = subprocess.run([sys.executable, "-m", "athermal", "fit"], cwd=tmp_path, capture_output=True, text=True)
    assert wrong.returncode == 2


def test_the_script_of_a_user_runs(tmp_path):
    from script_of_a_user import main

    assert 0 < main(tmp_path) < 1
    assert (tmp_path / "model.json").exists()

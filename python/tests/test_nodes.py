"""Nodes that are written in Python keep the rules that all others keep."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from pathlib import Path

import nodes_of_a_user as nodes
import pytest

import athermal
from athermal.conformance import Case, broken_rules
from conftest import GRAPH, parts

pytest_plugins = ["pytester"]


def graph_of(node, signal="temperature", **parameters):
    tree = athermal.Graph(GRAPH).to_dict()
    tree["nodes"]["mine"] = {
        "type": "python_feature",
        "python": node,
        "inputs": {"signal": signal},
        "parameters": parameters,
    }
    tree["outputs"]["mine"] = "mine"
    return athermal.Graph(tree)


def alone(node, **parameters):
    """A model with nothing that needs a fit."""
    tree = graph_of(node, **parameters).to_dict()
    del tree["signals"]["position"]
    tree["nodes"], tree["outputs"] = {"mine": tree["nodes"]["mine"]}, {"mine": "mine"}
    return athermal.Graph(tree).model()


def rows(frame, *names):
    return list(zip(*(frame[name] for name in names)))


def test_a_function_and_a_class_compute_what_they_say(week):
    model = graph_of(nodes.twice, factor=3.0).fit(week)
    predicted = model.predict(week)
    for given, made in rows({**week.to_dict(), **predicted.to_dict()}, "room_degC", "mine.room"):
        assert made is None if given is None else made == 3.0 * given
    model = graph_of(nodes.Difference, factor=0.5).fit(week)
    predicted = model.predict(week)
    assert predicted["mine.room"][0] is None
    expected = [0.5 * (b - a) for a, b in zip(week["room_degC"], week["room_degC"][1:])]
    assert predicted["mine.room"][1:] == expected


def test_features_of_python_feed_a_fit_as_others_do(week, columns):
    tree = athermal.Graph(GRAPH).to_dict()
    plain = athermal.Graph(copy.deepcopy(tree)).fit(week)
    tree["nodes"]["same"] = {"type": "python_feature", "python": nodes.twice, "inputs": {"signal": "gradients"}, "parameters": {"factor": 1.0}}
    tree["nodes"]["thermal"]["inputs"]["features"] = "same"
    through = athermal.Graph(tree).fit(week)
    ours, theirs = through.predict(week), plain.predict(week)
    assert ours["predicted.Z1"] == theirs["predicted.Z1"] and any(value is not None for value in ours["predicted.Z1"])


def estimated(**parameters):
    tree = athermal.Graph(GRAPH).to_dict()
    tree["nodes"]["thermal"].update(type="python_estimator", python=nodes.Nearest, parameters=parameters)
    return athermal.Graph(tree)


def test_an_estimator_of_python_is_fitted_scored_saved_and_read_again(week, tmp_path):
    model = estimated(floor=1.0).fit(week)
    (of, *_) = model.report.scores
    assert of["node"] == "thermal.Z1" and of["in_sample_rmse"] > 0
    assert athermal.evaluate(model, week).scores[0]["rmse"] > 0
    model.save(tmp_path / "model.json")
    again = athermal.Model.load(tmp_path / "model.json")
    assert again == model == pickle.loads(pickle.dumps(model))
    assert again.predict(week).to_dict() == model.predict(week).to_dict()
    other = week.to_dict()
    assert parts(estimated(floor=1.0).fit(other, threads=1)) == parts(model)


def test_another_process_reads_a_model_by_the_module_that_it_names(week, tmp_path):
    model = estimated().fit(week)
    model.save(tmp_path / "model.json")
    program = "import athermal; athermal.Model.load('model.json'); print('read')"
    call = lambda path: subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env={"PYTHONPATH": path, "PATH": ""}, capture_output=True, text=True
    )
    own = [str(Path(nodes.__file__).parent), str(Path(athermal.__file__).parents[1])]
    assert call(":".join(own)).stdout == "read\n"
    refused = call(own[1])
    assert refused.returncode == 1 and "No module named 'nodes_of_a_user'" in refused.stderr


def test_graphs_models_and_engines_are_pickled_with_their_nodes(week, tmp_path):
    pytest.importorskip("cloudpickle")
    model = graph_of(nodes.Difference, factor=0.5).fit(week)
    engine = model.engine()
    engine.step(1, {"temperature.room": 20.0})
    (tmp_path / "all").write_bytes(pickle.dumps((model.graph, model, engine)))
    program = (
        "import pickle; graph, model, engine = pickle.load(open('all', 'rb'));"
        "print(graph.outputs[-1], model.revision, engine.step(2, {'temperature.room': 22.0})['mine.room'])"
    )
    # The module of the node is not on the path.
    path = str(Path(athermal.__file__).parents[1])
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env={"PYTHONPATH": path, "PATH": ""}, capture_output=True, text=True)
    assert done.stdout.split() == ["mine.room", model.revision, "1.0"], done.stderr


def test_what_a_node_raises_is_raised_with_its_name(week):
    graph = graph_of(nodes.Failing)
    with pytest.raises(athermal.NodeError, match=r"node `mine` failed at .*: ZeroDivisionError: as a slip would") as error:
        graph.fit(week).predict(week)
    assert isinstance(error.value.__cause__, ZeroDivisionError)
    assert any("nodes_of_a_user" in str(line.path) for line in error.traceback) or error.value.__cause__.__traceback__
    engine = graph_of(nodes.twice).fit(week).engine()
    engine.step(1, {"temperature.room": 20.0})
    failing = alone(nodes.Failing).engine()
    with pytest.raises(athermal.NodeError, match="slip"):
        for nth in range(50):
            failing.step(nth, {"temperature.room": 20.0})


def test_an_interrupt_in_a_node_is_an_interrupt(week):
    @athermal.feature
    def interrupted(values):
        """Is interrupted."""
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        graph_of(interrupted).fit(week)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"python": "no_such_module:Node"}, "No module named 'no_such_module'"),
        ({"python": "nodes_of_a_user:Nothing"}, "no attribute 'Nothing'"),
        ({"python": "Nothing"}, "write `module:Name`"),
        ({"python": "math:sqrt"}, "not decorated"),
        ({"python": nodes.Nearest}, "not decorated with `@athermal.feature`"),
        ({"python": nodes.twice, "parameters": {"factr": 1.0}}, "factr"),
        ({}, "python"),
    ],
)
def test_what_cannot_be_used_is_a_mistake_of_the_graph(wrong, words):
    tree = athermal.Graph(GRAPH).to_dict()
    tree["nodes"]["mine"] = {"type": "python_feature", "inputs": {"signal": "temperature"}, **wrong}
    tree["outputs"]["mine"] = "mine"
    with pytest.raises(athermal.GraphError) as error:
        athermal.Graph(tree)
    assert words in str(error.value)


def test_outputs_of_another_number_are_refused_at_the_first_step(week):
    @athermal.feature(outputs=["one"])
    def two(values):
        """Gives two."""
        return [1.0, 2.0]

    with pytest.raises(athermal.NodeError, match="gives 2 values and has 1 outputs"):
        graph_of(two).fit(week).predict(week)


def test_a_state_that_is_no_json_is_refused_in_words():
    @athermal.feature
    class Pair:
        """Keeps a tuple."""

        def __init__(self, channels):
            self.pair = (1, 2)

        def step(self, now, values):
            return values

    engine = alone(Pair).engine()
    engine.step(1, {"temperature.room": 20.0})
    with pytest.raises(athermal.NodeError, match="define `snapshot` and `restore`"):
        engine.snapshot()


def test_what_is_called_as_an_argument_and_changed_is_in_a_snapshot():
    @athermal.feature
    class Smoothed:
        """The mean of what came, which begins at a level; and all that came."""

        def __init__(self, channels, level=20.0, seen=()):
            self.channels = tuple(channels)
            self.level = level
            self.seen = seen

        def step(self, now, values):
            for value in values:
                if value is not None:
                    self.level += (value - self.level) / 4
                    self.seen.append(value)
            return [self.level + len(self.seen)] * len(values)

    model = alone(Smoothed, seen=[1.0])
    engine = model.engine()
    for nth in range(5):
        engine.step(nth, {"temperature.room": 21.0 + nth})
    again = model.engine()
    again.restore(engine.snapshot())
    expected = engine.step(9, {"temperature.room": 25.0})
    assert again.step(9, {"temperature.room": 25.0}) == expected and expected["mine.room"] > 29
    # What an object did to a list that it was given is nothing that the next one is given.
    engine.segment()
    assert engine.step(10, {"temperature.room": 20.0})["mine.room"] == 22


def test_an_estimator_keeps_the_start_value_that_it_changed(week):
    @athermal.estimator
    class Mean:
        """The mean of the truth, which begins at a value."""

        def __init__(self, regressors, mean=0.0):
            self.regressors = regressors
            self.mean = mean

        def fit(self, rows, truths):
            self.mean += math.fsum(truths) / len(truths)

        def predict(self, row):
            return self.mean

    tree = athermal.Graph(GRAPH).to_dict()
    tree["nodes"]["thermal"].update(type="python_estimator", python=Mean, parameters={"mean": 1.0})
    predicted = [of for of in athermal.Graph(tree).fit(week).predict(week)["predicted.Z1"] if of is not None]
    assert len(set(predicted)) == 1 and predicted[0] != 1.0


def test_an_engine_of_a_graph_that_needs_a_fit_is_refused(week):
    graph = athermal.Graph(GRAPH)
    for asked in (graph.model().engine, lambda: graph.model().predict(week), lambda: athermal.evaluate(graph.model(), week)):
        with pytest.raises(athermal.RequestError, match=r"needs a fit of thermal.Z1, thermal.Z2: `Graph.fit\(data\)`"):
            asked()


def test_nodes_that_keep_the_rules_conform(athermal_conforms):
    athermal_conforms(nodes.twice, Case(parameters={"factor": 3.0}), Case(inputs={"signal": (1, "K", 15, 30)}))
    athermal_conforms(nodes.Difference)
    athermal_conforms(nodes.Nearest, Case(parameters={"floor": 1.0}))


@pytest.mark.parametrize(
    ("node", "rule"),
    [
        (nodes.zero_for_nothing, "absence"),
        (nodes.Shared, "long run"),
        (nodes.Forgetful, "restores"),
        (nodes.Failing, "ZeroDivisionError"),
        (nodes.undocumented, "explained"),
    ],
)
def test_a_node_that_breaks_a_rule_is_found_with_what_to_do(node, rule):
    broken = broken_rules(node)
    assert any(rule in text and "to do: " in text for text in broken), broken


def test_a_multiple_of_a_temperature_depends_on_its_unit():
    broken = broken_rules(nodes.twice, Case(inputs={"signal": (1, "Cel", 15, 30)}))
    assert any(text.startswith("units: ") for text in broken)


def test_a_wider_memory_than_stated_is_found():
    @athermal.feature(memory="1min")
    class Sum:
        """The sum of all that came."""

        def __init__(self, channels):
            self.sum = 0.0

        def step(self, now, values):
            self.sum += math.fsum(value for value in values if value is not None)
            return [self.sum] * len(values)

    assert any(text.startswith("memory") for text in broken_rules(Sum))


def test_the_plugin_fails_a_test_with_all_that_is_broken(pytester):
    pytester.makepyfile(
        test_mine="""
        import athermal

        @athermal.feature
        def wrong(values):
            return [0.0 if value is None else value for value in values]

        def test_it(athermal_conforms):
            athermal_conforms(wrong)
        """
    )
    result = pytester.runpytest_subprocess("-q", "-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*`wrong` breaks * of the rules that every node keeps*", "*to do: *"])

"""What is measured, predicted and left, the weights and the intervals, as matplotlib draws them."""

from __future__ import annotations

import math

import pytest

import athermal
from conftest import GRAPH
from test_given import dated
from test_frames import DATED

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

VOTED = GRAPH.replace(
    "[outputs]",
    """
[nodes.lazy]
type = "ar"
each = "axis"
inputs.truth = "drift.{axis}"
ahead = "5min"
lags = ["0s"]

[nodes.vote]
type = "auto_weighted"
memory = "15min"
each = "axis"
inputs.voters = ["thermal.{axis}", "lazy.{axis}"]
inputs.truth = "drift.{axis}"

[nodes.within]
type = "conformal"
each = "axis"
inputs.prediction = "vote.{axis}"
memory = "2h"
inputs.truth = "drift.{axis}"

[outputs]""",
).replace('predicted = "thermal"', 'predicted = "within"')


def lines(ax):
    return {line.get_label(): line for line in ax.get_lines()}


def test_axes_have_what_was_measured_and_predicted_and_what_is_left(model, week):
    axes = athermal.plot(model, week)
    assert axes.shape == (2, 2)
    course = {of["name"]: of for of in athermal.report(model, week)["course"]["axes"]}
    for nth, name in enumerate(["Z1", "Z2"]):
        top, left = lines(axes[0, nth]), lines(axes[1, nth])
        its = course[name]
        assert axes[0, nth].get_title() == name
        assert list(top["measured"].get_ydata()) == its["truth"]["value"]
        predicted = top[f"predicted, thermal.{name}"].get_ydata()
        value = its["voters"][its["main"]]["value"]
        assert [None if math.isnan(of) else of for of in predicted] == value and any(of is not None for of in value)
        differences = [None if of is None else truth - of for truth, of in zip(its["truth"]["value"], value)]
        assert [None if math.isnan(of) else of for of in left["left"].get_ydata()] == differences
        assert list(top["measured"].get_xdata()) == [of / 3600 for of in its["truth"]["time_s"]]
        # The standard deviation of a linear fit makes a band.
        assert [of.get_label() for of in axes[0, nth].collections] == ["interval"] and its["voters"][its["main"]]["interval"]
    assert "nm/min" in axes[0, 0].get_ylabel() and axes[-1, 0].get_xlabel() == "time in h"


def test_weights_and_intervals_are_drawn_where_there_are_any(week):
    model = athermal.Graph(VOTED).fit(week)
    axes = athermal.plot(model, week, of="Z2")
    assert axes.shape == (3, 1) and axes[0, 0].get_title() == "Z2"
    weights = lines(axes[2, 0])
    assert set(weights) == {"thermal", "lazy"}
    sums = [a + b for a, b in zip(*(of.get_ydata() for of in weights.values())) if not math.isnan(a + b)]
    assert sums and all(of == pytest.approx(1) for of in sums)
    both = athermal.plot(model, week, of=["thermal.Z1", "Z2"])
    assert both.shape == (3, 2)
    [its] = [of for of in athermal.report(model, week)["course"]["axes"] if of["name"] == "Z2"]
    within = its["voters"][its["main"]]
    assert within["prediction"] == "within.Z2" and len(within["interval"]) == len(its["truth"]["value"])
    ends = [of for of in within["interval"] if None not in of]
    assert ends and all(low <= high for low, high in ends)
    [band] = both[0, 1].collections
    low, high = band.get_datalim(both[0, 1].transData).intervaly
    assert (low, high) == pytest.approx((min(of[0] for of in ends), max(of[1] for of in ends)))


def test_dates_are_dates_and_axes_of_a_caller_are_drawn_on():
    from datetime import timezone

    from matplotlib import pyplot

    model = athermal.Graph(DATED).fit(dated(timezone.utc))
    _, mine = pyplot.subplots(2, 1)
    axes = athermal.plot(model, dated(timezone.utc), of="Z1", axes=mine)
    assert axes[0, 0] is mine[0] and axes[-1, 0].get_xlabel() == "time"
    assert str(lines(mine[0])["measured"].get_xdata()[0]).startswith("2026-03-02")
    with pytest.raises(athermal.RequestError, match="2 rows of 2 axes are drawn, and 2 were given"):
        athermal.plot(model, dated(timezone.utc), axes=mine)
    with pytest.raises(athermal.RequestError, match="no truth Z3 to plot: there are Z1, Z2"):
        athermal.plot(model, dated(timezone.utc), of="Z3")
    pyplot.close("all")

"""What a model predicts and what is left, drawn by matplotlib, which is imported once it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from athermal._errors import RequestError

_ROWS = ["measured and predicted", "left", "weights"]


def draw(course: dict[str, Any], of: str | Sequence[str] | None, axes: Any) -> Any:
    """Draws the truths of the course of a report, one a column."""
    try:
        import numpy
        from matplotlib import pyplot
    except ImportError as error:
        raise RequestError("to plot, install matplotlib") from error

    truths = _chosen(course["axes"], of)
    rows = 3 if any(truth["weights"] for truth in truths) else 2
    if axes is None:
        _, axes = pyplot.subplots(rows, len(truths), sharex=True, squeeze=False, layout="constrained", figsize=(1 + 5 * len(truths), 2.5 * rows))
    axes = numpy.array(axes, dtype=object)
    if axes.size != rows * len(truths):
        raise RequestError(f"{rows} rows of {len(truths)} axes are drawn, and {axes.size} were given: {', '.join(_ROWS[:rows])}")
    axes = axes.reshape(rows, len(truths))

    def numbers(values: Any) -> Any:
        return numpy.array(values, dtype=float)

    for nth, truth in enumerate(truths):
        time = numbers(truth["truth"]["time_s"])
        # Times of a clock that began with 1970 are dates.
        is_dated = len(time) and time[0] > 1e8
        at = (time * 1e3).astype("M8[ms]") if is_dated else time / 3600
        measured, main = numbers(truth["truth"]["value"]), truth["voters"][truth["main"]]
        predicted = numbers(main["value"])
        top, left = axes[0, nth], axes[1, nth]
        top.plot(at, measured, ".", markersize=2, color="0.4", label="measured")
        top.plot(at, predicted, linewidth=1, label=f"predicted, {main['prediction']}")
        if main.get("interval"):
            ends = numbers(main["interval"])
            top.fill_between(at, ends[:, 0], ends[:, 1], alpha=0.25, linewidth=0, label="interval")
        left.plot(at, measured - predicted, linewidth=1, label="left")
        left.axhline(0, color="0.6", linewidth=0.5)
        for row, unit in ((top, truth["unit"]), (left, truth["error_unit"])):
            row.set_ylabel(unit)
        for weight in truth["weights"]:
            axes[2, nth].plot(at, numbers(weight["value"]), linewidth=1, label=weight["voter"])
        top.set_title(truth["name"])
        for row, name in zip(axes[:, nth], _ROWS):
            if row.get_legend_handles_labels()[0]:
                row.legend(loc="upper right", fontsize="small")
            if nth == 0:
                row.set_ylabel(" in ".join(filter(None, [name, row.get_ylabel()])))
        axes[-1, nth].set_xlabel("time" if is_dated else "time in h")
    return axes


def _chosen(truths: list[dict[str, Any]], of: str | Sequence[str] | None) -> list[dict[str, Any]]:
    names = [of] if isinstance(of, str) else of
    if names is None:
        if not truths:
            raise RequestError("the graph has no prediction of a measured truth, so there is nothing to plot")
        return truths
    known = {name: truth for truth in truths for name in (truth["name"], *(voter["prediction"] for voter in truth["voters"]))}
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        raise RequestError(f"there is no truth {', '.join(unknown)} to plot: there are {', '.join(truth['name'] for truth in truths)}")
    return [known[name] for name in names]

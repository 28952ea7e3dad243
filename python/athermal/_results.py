"""What functions of the package find out: to print, to look at in a notebook, and as plain values."""

from __future__ import annotations

import os
from html import escape
from typing import Any

_STYLE = (
    "<style>.athermal td,.athermal th{text-align:right;padding:2px 10px;white-space:nowrap}"
    ".athermal td:first-child,.athermal th:first-child{text-align:left}</style>"
)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.4g}"
    return escape(str(value))


def html_table(head: list[str], rows: list[list[Any]]) -> str:
    heads = "".join(f"<th>{escape(of)}</th>" for of in head)
    lines = "".join("<tr>" + "".join(f"<td>{_cell(of)}</td>" for of in row) + "</tr>" for row in rows)
    return f"<table class='athermal'><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>"


class Facts:
    """Facts of a command: `str` is what the command line prints, `facts` is what it writes with `--format json`."""

    def __init__(self, text: str, facts: dict[str, Any]) -> None:
        self.text = text
        self.facts = facts

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text

    def __getitem__(self, key: str) -> Any:
        return self.facts[key]

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


class Scores(Facts):
    """How well predictions of a model are."""

    @property
    def scores(self) -> list[dict[str, Any]]:
        """A row for each prediction."""
        return list(self.facts["scores"])

    def _repr_html_(self) -> str:
        head = ["prediction", "truth", "unit", "n", "RMSE", "R²", "R²mean", "no model", "persistence", "bias", "valid"]
        keys = ["output", "truth", "unit", "n", "rmse", "r2_zero", "r2_mean", "baseline_zero", "baseline_persistence", "bias", "valid"]
        return _STYLE + html_table(head, [[of.get(key) for key in keys] for of in self.scores])


class Comparison(Facts):
    """Several graphs, fitted and scored on the same data."""

    @property
    def comparisons(self) -> list[dict[str, Any]]:
        """A table for each unit and horizon."""
        return list(self.facts["comparisons"])


class Diagnosis(Facts):
    """Why a model predicts as well as it does."""

    @property
    def diagnosis(self) -> dict[str, Any]:
        """The facts."""
        return dict(self.facts["diagnosis"])


class Report(Facts):
    """What a model is worth: a page with its pictures."""

    def __init__(self, text: str, facts: dict[str, Any], page: str) -> None:
        super().__init__(text, facts)
        self.html = page

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the page, which needs nothing else."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.html)

    def _repr_html_(self) -> str:
        # The page has a style of its own, which must not become that of the notebook.
        page = escape(self.html, quote=True)
        return f'<iframe srcdoc="{page}" sandbox="" style="width:100%;height:700px;border:0"></iframe>'


class FitReport(Facts):
    """How the fit of a model went, as far as its card knows."""

    def __init__(self, text: str | None, card: dict[str, Any] | None) -> None:
        card = card or {}
        super().__init__(_summary(card) if text is None else text, card)

    @property
    def estimators(self) -> list[dict[str, Any]]:
        """An object for each node that was fitted."""
        return list(self.facts.get("estimators", []))

    @property
    def scores(self) -> list[dict[str, Any]]:
        """Of each node its truth, its rows, its error on the rows of the fit, and the mean R² of the cross-validation."""
        return [
            {
                "node": of["node"],
                "truth": of["truth"],
                "unit": of["unit"],
                "rows": of["rows"],
                "in_sample_rmse": of.get("in_sample_rmse"),
                "r2": of["selection"][-1]["score"] if of.get("selection") else None,
            }
            for of in self.estimators
        ]

    @property
    def chosen(self) -> dict[str, list[str]]:
        """The regressors that each node chose, in the order in which it did; none where it takes all."""
        return {of["node"]: _chosen(of.get("selection", [])) for of in self.estimators}

    def _repr_html_(self) -> str:
        head = ["node", "truth", "unit", "rows", "in-sample RMSE", "R²", "chosen"]
        chosen = self.chosen
        rows = [[*of.values(), ", ".join(chosen[of["node"]])] for of in self.scores]
        return _STYLE + html_table(head, rows)


def _chosen(steps: list[dict[str, Any]]) -> list[str]:
    chosen: list[str] = []
    for step in steps:
        (chosen.remove if step.get("removed") else chosen.append)(step["regressor"])
    return chosen


def _summary(card: dict[str, Any]) -> str:
    lines = [f"{of['node']} ({of['type']} of {of['truth']}): {of['rows']} rows" for of in card.get("estimators", [])]
    return "\n".join(lines) + "\n" if lines else "nothing was fitted\n"


def coefficients_html(estimators: list[dict[str, Any]]) -> str:
    rows: list[list[Any]] = []
    for of in estimators:
        for nth, one in enumerate(of.get("coefficients") or []):
            per = f"{of['unit']} per {one['per']}" if one.get("per") else of["unit"]
            node = of["node"] if nth == 0 else ""
            rows.append([node, one["name"], one["value"], one.get("standard_error"), per])
    return _STYLE + html_table(["node", "coefficient", "value", "standard error", "unit"], rows)

"""The notebook for new users runs from its first cell to its last, and what it says of its output is so."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "first-steps.ipynb"
NUMBER = r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?"


def numbers(text):
    """The numbers of a text, each with how many decimals it has."""
    for number in re.findall(NUMBER, text):
        number = number.replace(",", "")
        yield float(number), len(number.partition(".")[2])


def test_a_kernel_shows_the_notebook_without_an_error_and_it_says_what_is_shown(tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pages = ["".join(of["data"].get("text/html", "")) for of in outputs if "data" in of]
    assert (tmp_path / "report.html").read_text().startswith("<!")
    assert any("<progress" in page and "done" in page for page in pages)
    assert any(page.startswith("<svg") for page in pages) and any("<table" in page for page in pages)
    assert any("image/png" in of.get("data", {}) for of in outputs)

    said = 0
    for cell, after in zip(notebook.cells, notebook.cells[1:]):
        shown = [of.get("text", "") + str(of.get("data", {}).get("text/plain", "")) for of in cell.get("outputs", [])]
        if not shown:
            continue
        assert after.cell_type == "markdown" and not after.source.startswith("#"), cell.source
        there = [abs(value) for value, _ in numbers("\n".join(shown).replace("_", " "))]
        for value, decimals in numbers(after.source):
            # Numbers below ten without decimals are words.
            if decimals or abs(value) >= 10:
                assert any(abs(round(of, decimals) - abs(value)) < 1e-9 for of in there), (after.source, value)
                said += 1
    assert said > 25

"""The notebook for new users runs from its first cell to its last."""

from __future__ import annotations

from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "first-steps.ipynb"


def test_a_kernel_shows_the_notebook_without_an_error(tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pages = ["".join(of["data"].get("text/html", "")) for of in outputs if "data" in of]
    assert (tmp_path / "report.html").read_text().startswith("<!")
    assert any("<progress" in page for page in pages)
    assert any(page.startswith("<svg") for page in pages) and any("<table" in page for page in pages)

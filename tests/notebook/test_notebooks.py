"""The notebooks of examples/ are kept without output and run from the first cell to the last."""

from __future__ import annotations

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="comes with nbclient, of the extra test")

NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples" / "notebooks").glob("*.ipynb"))


def cells(path):
    return nbformat.read(path, as_version=4).cells


def test_there_are_some():
    assert len(NOTEBOOKS) >= 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_valid_says_what_it_is_about_and_holds_no_output(path):
    nbformat.validate(nbformat.read(path, as_version=4))
    assert cells(path)[0].source.startswith("# ")
    assert [cell.source for cell in cells(path) if cell.cell_type == "code" and cell.outputs] == []


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path, tmp_path):
    nbclient = pytest.importorskip("nbclient")
    book = nbformat.read(path, as_version=4)
    place = {"metadata": {"path": tmp_path}}
    nbclient.NotebookClient(book, timeout=300, kernel_name="python3", resources=place).execute()
    code = [cell for cell in book.cells if cell.cell_type == "code"]
    # The last cell shows what the notebook was about.
    assert any(output.output_type == "execute_result" for output in code[-1].outputs)
    shown = [output for cell in code for output in cell.outputs]
    assert [output.text for output in shown if output.output_type == "stream" and output.name == "stderr"] == []

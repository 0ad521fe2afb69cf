"""What ARCHITECTURE.md says of adding something is so: an example of each touches the files of its list, and works."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

from .architecture import PAGE, recipes
from .worked_examples import EXAMPLES, NAME, Edit, Example, apply, run_compiler, run_python

LISTS = recipes(PAGE.read_text(encoding="utf-8"))
COMPILER = os.environ.get("CXX") or shutil.which("g++") or shutil.which("c++")


def test_everything_that_can_be_added_has_an_example():
    assert EXAMPLES.keys() == LISTS.keys()


@pytest.mark.parametrize("title", EXAMPLES)
def test_an_example_touches_the_files_of_its_list(title):
    assert {edit.path for edit in EXAMPLES[title].edits} == {step.path.replace("NAME", NAME) for step in LISTS[title]}


@pytest.mark.parametrize("title", EXAMPLES)
def test_an_example_works(title, tmp_path):
    example = EXAMPLES[title]
    apply(example, tmp_path)
    run_python(example.python, tmp_path)


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler")
@pytest.mark.parametrize("title", [title for title, example in EXAMPLES.items() if example.compiled])
def test_an_example_compiles(title, tmp_path):
    assert COMPILER is not None
    apply(EXAMPLES[title], tmp_path)
    for source in EXAMPLES[title].compiled:
        run_compiler(COMPILER, source, tmp_path)


def test_an_example_that_does_not_work_is_seen(tmp_path):
    light = EXAMPLES["A light type"]
    without_list = Example(tuple(edit for edit in light.edits if "description" not in edit.path), light.python)
    apply(without_list, tmp_path)
    with pytest.raises(subprocess.CalledProcessError):
        run_python(without_list.python, tmp_path)


def test_an_edit_whose_place_is_gone_is_seen(tmp_path):
    gone = Example((Edit("renderer/primray/version.py", "not there", "x"),))
    with pytest.raises(AssertionError, match="0 places"):
        apply(gone, tmp_path)

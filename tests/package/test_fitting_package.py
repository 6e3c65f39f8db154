"""What `fitting` offers: names, help, types, and nothing imported before it is used."""

import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

import fitting


def test_every_name_is_there_and_documented():
    assert set(fitting.__all__) <= set(dir(fitting))
    for name in fitting.__all__:
        assert getattr(fitting, name).__doc__, name
    assert fitting.__version__.count(".") >= 2
    assert fitting.samples.sample.Sample is fitting.Sample
    with pytest.raises(AttributeError, match="no attribute 'fits_model'"):
        _ = fitting.fits_model


def test_help_lists_the_functions():
    text = pydoc.render_doc(fitting, renderer=pydoc.plaintext)
    for name in ("fit", "fit_many", "fit_residuals", "choose", "read_csv", "simulate"):
        assert f"{name}(" in text


def test_types_ship():
    assert (Path(fitting.__file__).parent / "py.typed").exists()


def test_importing_it_imports_no_jax():
    code = "import sys, fitting; print('jax' in sys.modules, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_old_names_have_left():
    for name in ("fit_model", "fit_points", "FitResult", "ModelFit", "PointFits", "predict"):
        assert not hasattr(fitting, name)

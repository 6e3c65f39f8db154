"""`Fit`: the result of a fit with what users ask of it: curves, tables, pictures and files."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitting.data.drawing import check_matplotlib
from fitting.data.measurement import Measurement
from fitting.outcomes.findings import with_headline
from fitting.output import export, files, page, pictures, summary
from fitting.predictions import predict
from fitting.residuals.residuals import residuals
from fitting.results.result import FitData
from fitting.results.result_parts import Prediction


class Fit(FitData):
    """A `FitData` that can be asked for curves, printed, drawn and written.

    Its attributes are those of `FitData`.
    """

    @classmethod
    def of(cls, data: FitData) -> Fit:
        """Return the result with these data; its status is that which its warnings leave."""
        return cls(**vars(with_headline(data)))

    def predict(self, at: Any = None, quantity: Any = "R", wavelength_um: Any = None) -> Prediction:
        """Return the values that the fitted sample gives, with their standard errors.

        Args:
            at: None for the data that were fitted; a `Measurement` for its rows; or angles of
                incidence in degrees, (A,).
            quantity: "R_s", "R_p", "R", "T", "psi", ... at the angles: one, or one for each angle.
            wavelength_um: micrometres, at the angles: one, or one for each angle. Left out where
                each fit of the batch has its own.

        Returns:
            `Prediction` of shape (N,) at data and rows; S + (A,) at angles.
        """
        return predict(self, at, quantity, wavelength_um)

    @property
    def residuals(self) -> np.ndarray:
        """value - fitted of every datum, (N,); for Delta in -180 to 180."""
        fitted = self.predict().value
        assert self.measurement is not None  # else there is no prediction for it
        return residuals(self.measurement, fitted)

    def __repr__(self) -> str:
        return summary.one_line(self)

    def __str__(self) -> str:
        return summary.table(self)

    def _repr_html_(self, choice: Any = None) -> str:
        """Return the cell of a notebook; choice: the `Choice` of which this is the fit."""
        drawn = self.shape or self.measurement is not None
        png = b""
        if drawn and importlib.util.find_spec("matplotlib") is not None:
            png = pictures.picture_bytes(pictures.draw(self, warnings=False), ".png")
        return page.notebook(self, png, choice)

    def plot(
        self, reference: str | None = None, others: FitData | Sequence[FitData] = (),
        measurement: Measurement | None = None,
    ) -> Any:  # fmt: skip
        """Return a matplotlib Figure of data, fit and residuals.

        It shows data with one-sigma error bars, fitted curves with their one-sigma bands, and below
        them data - fit: powers, psi and Delta each in panels of their own, over the angle, or over
        the wavelength if there are several (of up to 12 angles three together). Then follow eta
        and, where it is not 0 everywhere, k, with 95 % upper limits, and a tick on the axis where
        the data do not determine them. Of a batch without data the fitted parameters are drawn. The
        warnings stand below. Wavelengths are labelled in nm, from 10 um on in um; the coordinates
        of the axis are micrometres.

        Args:
            reference: a named material, whose eta and k are drawn for comparison; at one wavelength
                they stand below, as numbers.
            others: further fits, of these data or of the same quantities, whose curves, residuals,
                eta and k are drawn, too.
            measurement: the data of one curve of `fit_many`, which keeps none; or others at which
                the fit is looked at.

        Raises:
            ImportError: where matplotlib is not installed.
            ValueError: for an unknown material, or where there is nothing to draw.
        """
        others = (others,) if isinstance(others, FitData) else others
        return pictures.draw(self, reference, others, measurement=measurement)

    def report(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write a page and its files to a new or empty folder; ``overwrite``: to any folder.

        All of it or, if that fails, nothing: report.html, fit.json, data.csv, fit.png, and
        index.csv of a spectrum or a batch. The folder is created if there is none. Raises
        ImportError without matplotlib, ValueError for a folder that cannot be written to.
        """
        check_matplotlib("report")
        without = ["csv"] * (self.measurement is None)
        without += ["index"] * (not self.shape and len(summary.index_waves(self)) < 2)
        files.write_checked(
            self, files.report_files(folder, without, overwrite=overwrite), overwrite
        )

    def write_material(
        self, path: str | os.PathLike[str], medium: str | None = None, *, overwrite: bool = False
    ) -> Any:
        """Write eta and k of a medium as refractiveindex.info YAML, and its errors as CSV.

        Both or neither; returns the paths. ``overwrite``: replace files that no fit wrote, too.
        """
        wanted = files.material_files(path, (medium,))
        return tuple(file.path for file in files.write_checked(self, wanted, overwrite))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for ``json.dumps``: NaN and infinity as None, arrays as lists.

        The names are those of the fields of `Fit` and `Estimate`; a warning has its code, where it
        holds, its values and its sentence. Of a batch warnings and alternatives are a list for each
        fit, in the order of the batch.
        """
        return export.to_dict(self)

    def to_dataframe(self) -> Any:
        """Return a pandas DataFrame: a row for each fit of a batch, else for each parameter.

        A batch has the wavelength (or the place in the batch) as index. A single fit has the fields
        of `Estimate`, with the interval as ``low`` and ``high`` and the name of the parameter as
        index. Raises ImportError where pandas is not installed.
        """
        return export.to_dataframe(self)

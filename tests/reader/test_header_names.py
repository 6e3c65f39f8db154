"""Header names, as laboratories write them, and what a reader of them would say they mean."""

import pytest

from fitting.reader.names import role_of

AXES = {
    "incidence": "angle_deg|AOI|theta|Einfallswinkel|incidence_angle|Angle of Incidence"
    "|\u03b8 [\u00b0]"
    "|Einfallswinkel \u03b1 (\u00b0)"
    "|theta_i (rad)|aoi (degree)|angle of incidence / deg|Angle d'incidence",
    "grazing": "grazing angle (deg)|glancing angle",
    "q": "Qz (1/angstrom)|q|Q (1/nm)|Q [\u00c5\u207b\u00b9]",
    "wavelength": "Wavelength (nm)|lambda_nm|\u03bb / nm|Wellenl\u00e4nge in nm|Wavelength, \u00b5m"
    "|nm|WL",
    "energy": "photon_energy_eV|E (eV)|Energy|eV",
    "wavenumber": "wavenumber (cm-1)|Wave number|cm-1",
    "frequency": "frequency (THz)|f (THz)",
}
VALUES = {
    "R": "R|reflectivity (-)|Reflection (%)|%R|R%|R_front|Ravg|unpolarized reflectance|R (a.u.)"
    "|Reflectances",
    "R_s": "Rs|R_s|R_TE|R\u22a5|Reflectance (s)|s-pol reflectance|Rss|R_perp"
    "|Reflectance TE [%]|rs (%)|r_s [%]",
    "R_p": "Rp|R_p|RTM|R\u2225|p polarized reflectance (%)|Rpp|R_parallel|pR|R p-pol",
    "R_back": "R_back|back reflectance|R back (%)",
    "T": "T|transmittance|%T|Transmission (%)|Transmittances",
    "T_s": "Ts|T_s|T_TE",
    "psi": "Psi|\u03c8|PSI AVG (rad)|psi_deg",
    "delta": "Delta|\u0394|DELTA AVG (rad)|delta_deg|Delta (\u00b0)",
}
ERRORS = {
    "R_s": "sigma_R_s|Rs_std|R_s err|std(R_s)|Stdev of Rs|dRs|\u0394R_s|se_R_s|RsStd|Error R_s",
    "psi": "PSI STDEV (rad)|d_psi|sigma psi",
    "": "err|sigma|uncertainty (%)|std|error bar",
}
NOTHING = (
    "x|n|k|T (K)|t|time|ts|temperature|2|RMSE|Zone|Bandwidth|mount angle|motor "
    "(mm)|signal_V|counts"
    "|tan psi|cos(delta)|R of sample 2|R(532nm)|Rs_45|R_s_p|R T|T_back|R_back_s|deg|%|45|analyzer "
    "(deg)"
    "|dQ|sigma wavelength|angle error|log R|r|psi_s|2theta|2Theta (deg)|two theta"
)


@pytest.mark.parametrize("form", AXES)
def test_axes(form: str) -> None:
    for name in AXES[form].split("|"):
        role = role_of(name)
        assert (role.kind in ("angle", "wavelength"), role.form) == (True, form), name


@pytest.mark.parametrize("quantity", VALUES)
def test_values(quantity: str) -> None:
    for name in VALUES[quantity].split("|"):
        assert role_of(name)[:2] == ("value", quantity), name


@pytest.mark.parametrize("quantity", ERRORS)
def test_standard_errors(quantity: str) -> None:
    for name in ERRORS[quantity].split("|"):
        assert role_of(name)[:2] == ("sigma", quantity), name


def test_what_is_not_wholly_understood_is_not_understood_at_all() -> None:
    for name in NOTHING.split("|"):
        assert role_of(name).kind in ("", "index", "aside"), name
    for name in ("sR", "sT", "sPsi"):
        assert role_of(name).kind == "unclear", name


def test_a_small_r_is_an_amplitude_or_a_reflectance() -> None:
    for name in ("rs", "r_s", "rTE", "r_perp", "r-spol", "rs (-)"):
        assert role_of(name)[:2] == ("unclear", "R_s"), name
    for name in ("rp", "r_p", "rTM", "r_par", "rpp"):
        assert role_of(name)[:2] == ("unclear", "R_p"), name


def test_names_of_a_polarization_alone_say_of_nothing_how_large_it_is() -> None:
    for name in [
        "s",
        "TE",
        "te (%)",
        "s-pol",
        "perpendicular",
        "senkrecht",
        "⊥",
        "P",
        "TM",
        "parallel",
    ]:
        assert role_of(name).kind == "", name


def test_names_that_give_the_angle_of_their_column() -> None:
    for name in (
        "R(45 deg) [%]",
        "R_45deg",
        "R@45",
        "R (AOI=45 deg)",
        "R (AOI 45)",
        "R, theta = 45",
    ):
        assert role_of(name)[:2] == ("value", "R") and role_of(name).at == 45.0, name
    assert role_of("Rs@5").at == 5.0 and role_of("err_Rp (AOI 62.5)").kind == "sigma"
    for name in ("R(theta=1.05)", "R@1.05", "R (phi = 45)", "R' (45 deg)"):
        assert role_of(name).kind == "", name
    assert role_of("R_45").kind == "" and "number" in role_of("R_45").why  # an angle or a sample


def test_units() -> None:
    units = {
        "R (%)": "percent",
        "R/%": "percent",
        "R_percent": "percent",
        "R (-)": "1",
        "R (a.u.)": "arb",
        "lambda_nm": "nm",
        "Wavelength, \u00b5m": "um",
        "\u03bb (\u00c5)": "angstrom",
        "E [eV]": "eV",
        "k (cm\u207b\u00b9)": "cm-1",
        "f / THz": "THz",
        "aoi_deg": "deg",
        "theta in rad": "rad",
        "R ()": "",
    }
    for name, unit in units.items():
        assert role_of(name).unit == unit, name
    assert role_of("Lambda", "nm").unit == "nm" and role_of("Lambda (um)", "nm").unit == "um"

"""Small runs of the accuracy search and of the study of jit; places that searches found."""

import subprocess
import sys

import gmpy2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.accuracy import search_functions
from benchmarks.accuracy.search import FUNCTIONS, search
from benchmarks.accuracy.search_mixed import incoherent
from benchmarks.accuracy.search_quantities import PROGRAMS, QUANTITIES, errors
from benchmarks.studies import jit_study
from tests.truth.exact_fresnel import CONTEXT

DTYPES = pytest.mark.parametrize("dtype", [np.float64, np.float32])

# Left to `make accuracy-search`: these compile, or their truths take, a minute each.
SLOW = ("stack", "BrendelBormann", "FresnelFilm", "fields_at_depth")

FOUND = [
    # R_p was 14.3 eps off, psi's gradient 650 eps
    ("R and T of s and p", 0.025124871623660606, 2.5913305176464387, 2.7328098188650033e-06,
     1.619801270789544),
    ("gradient of psi and Delta", 0.043154755027216454, 0.05000543104864758, 10.0,
     1.4443759724348906),
    ("R and T of s and p", 0.9999999999999984, 2.210995265956301, 0.0, 1.865632072519508),
    ("R and T of s and p", 0.9999998807907104, 1.047820806503296, 0.055474746972322464,
     0.047678861767053604),
    ("R and T of s and p", 0.024690748941673578, 94199.39447348083, 1.9874574374271377, 1.0),
    ("R and T of s and p", 0.9999994447723466, 1.000029459812154, 0.0, 1.0),
    # 1 / (Q S^2) was infinite, and the gradient NaN
    ("gradient of amplitudes", 9.999999960041972e-13, 0.03478424996137619, 0.0,
     0.03478424996137619),
    # T_p of 3e-34 is 0 in float32, which is below what counts
    ("R and T of s and p", 4.492528293820186e-10, 1.4276119145506527e-05,
     3.0162702556300596e-23, 0.07156472653150558),
]  # fmt: skip


# A thick layer in which light is evanescent: 8e8 eps of what it absorbs. An opaque film whose T of
# 8e-37 was formed from squares that underflow in float32: 69 eps. A film behind an absorbing medium
# next to Brewster's angle, where the root with Im Q >= 0 runs backward: 1,355 eps of R_p. A
# uniaxial film of small ordinary index: 434 eps of its results.
FOUND_VALUES = [
    ("stack with rough boundaries", 1.0, 1.7914300213550294, 3.6606898748364674, 4.618108112516384,
     0.3138130784345965, 0.0001232561928857477, 1.0705799728512793, 0.7642131087071653,
     0.00028713939464234875, 0.00010871020361124289),
    ("stack of a thick layer", 0.5128393579184589, 1.4047774935977313, 0.16716111941002404,
     6.61411388669377e-09, 0.5109108674123908, 2.3437046493993675e-09, 164.56504371186415,
     0.31245456511599606),
    ("stack of two layers behind an absorbing medium", 0.7342817751583173, 1.5095075228112402,
     1.6480706569280872e-06, 1.3943703537026428, 5.408006983799855e-09, 0.1457677001253516,
     1.422504962060351, 1.6973755951499037, 0.0039201002193782995, 0.2696323266190728,
     0.05767106553455538, 1.5112301991423398),
    ("stack of uniaxial media", 0.08079139078562865, 1.8042669800716717, 0.1000000000062878,
     9.902361839961126e-09, 2.2181564861984806, 5.0, 1.7254193322423073, 4.611990458907737,
     2.5618543775741514, 2.2714429183307486e-06, 0.09553435439601701, 0.3403038595085244),
]  # fmt: skip

# Light tunnels to a guided mode; the last medium at its critical angle behind an opaque film.
# Formed from changes of the fields, the absorption's gradient was 933 and 13,000 eps off.
# A thick layer behind grazing incidence, and a window: 6e5 and 2e5 eps of gradients. A film with
# rough boundaries in which Q is small: a part of the derivative was missing. Total reflection by a
# thick layer: R_p by the cosine was 148 eps off, as what is left of the derivative of r. A rough
# film in front of a medium of small index: 548 eps, as what is left of changes of all fields. A
# thin rough film: 1e14 eps of what it absorbs, as its rear boundary was counted twice.
FOUND_IN_STACKS = [
    ("of a thick layer", 0.9877349978502398, 1.788817596321981, 0.27438533973883916,
     3.5059354584830683e-09, 0.21091259793981826, 1.371152125674556e-06, 6197.648859719227,
     0.5847139851924896),
    ("of a thick layer", 1.9860298908786384e-05, 1.62525137924984, 3.153500490785423,
     0.0042649680157925375, 0.6527474108050967, 5.317726082610578e-09, 1155.4334089086963,
     1.3237832096540914),
    ("with rough boundaries", 1.0, 1.1644903396881325, 3.2932872889394655, 2.2072821894056243,
     0.1221850154852436, 1.5060399331009968e-07, 0.4284012527199969, 0.5675251494233149,
     0.0014295004205669391, 3.7679181896804296e-05),
    ("of a thick layer", 0.00018782816220640878, 1.5103956057986858, 4.793204366539424,
     8.218137836700505e-09, 0.1261926164292452, 0.16045227144154003, 3.769064870593461,
     1.6160034090024598),
    ("of a thick layer", 0.2896485064682798, 1.814489784910799, 2.849375576370621,
     4.356248926389866e-07, 1.3410108583559834, 1.8937411213752438e-08, 9891.088807232709,
     1.622332706759641),
    ("with rough boundaries", 1.0, 1.7608379910016116, 0.6913643775212683, 1.0323860373000402e-07,
     2.3736647212159587, 6.511544833872484e-08, 0.058139588008580885, 0.5075976645078799,
     0.00462662724098218, 0.0011808654215018995),
    ("of three layers", 0.19190040534974577, 1.5792647682108616, 0.693267441316778,
     4.5562310018311425e-07, 3.1826860542901865, 2.5124773780885063e-08, 0.4412085007664903,
     2.0575973537518502e-08, 4.146702132260618, 4.960255087064993e-07, 0.7097542471014475,
     0.12893344614165786, 1.3611226986122886, 0.7420814870551662),
    ("of one layer", 0.2896460421778456, 1.400274308378159, 1.6065772479080302, 1.9276572940917078,
     1.3402499131050591, 6.229691192457111e-09, 0.5117356072193541, 0.5867420251074318),
    ("with rough boundaries", 0.809268099116678, 1.6575821069763248, 0.12319406880803344,
     1.1469227696539286e-08, 3.993011259987055, 8.34477067161853e-08, 0.0002637363956908925,
     1.3005809994417694, 0.0007363068246068241, 0.0033420181002318393),
    ("of one layer", 1.0, 1.852833622702542, 1.9197323233159316, 1.2011265953002446, 0.1,
     0.08155176752669595, 1.1046071408286287, 0.8167908740237564),
]  # fmt: skip


# A program of each takes eight seconds to compile.
@pytest.mark.study
@DTYPES
@pytest.mark.parametrize("case", FOUND_VALUES)
def test_values_that_were_found(case, dtype):
    name, *point = case
    entry = FUNCTIONS[name]
    columns = [np.array([x], dtype) for x in point]
    assert search_functions.errors(entry, False, columns, dtype) <= entry.bound


@pytest.mark.study
@DTYPES
@pytest.mark.parametrize("case", FOUND_IN_STACKS)
def test_gradients_of_stacks_that_were_found(case, dtype):
    name, *point = case
    entry = FUNCTIONS[f"gradient of stack {name}"]
    columns = [np.array([x], dtype) for x in point]
    assert search_functions.errors(entry, True, columns, dtype) <= entry.gradient_bound


@DTYPES
@pytest.mark.parametrize("case", FOUND)
def test_places_that_were_found(case, dtype):
    name, *point = case
    points = [np.array([x], dtype) for x in point]
    for program in PROGRAMS if point[2] == 0.0 else ("all given", "no eta_i"):
        if ("eta_i" in program and point[3] != 1.0) or (program == "neither" and point[3] != 1.0):
            continue
        assert errors(name, program, points, dtype) <= QUANTITIES[name].bound_at(points)


@pytest.mark.study
@DTYPES
@pytest.mark.parametrize("name", QUANTITIES)
def test_a_short_search(name, dtype):
    # which arguments are given decides the program; it does so alike in float32
    for i, program in enumerate(PROGRAMS if dtype is np.float64 else ["all given"]):
        random = np.random.default_rng([20261122, i])
        worst, place, _ = search(name, program, dtype, random, 512)
        assert worst <= 1.0, (program, place)


@DTYPES
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(x, marks=[pytest.mark.study] * (x != "approximate.f82"))
        for x in FUNCTIONS
        if not any(y in x for y in SLOW)
    ],
)
def test_a_short_search_of_every_other_function(name, dtype):
    entry = FUNCTIONS[name]
    bounds = {False: entry.bound, True: entry.gradient_bound}
    kinds = [gradient for gradient, bound in bounds.items() if bound is not None]
    for gradient in kinds:
        random = np.random.default_rng(20261122)
        worst, place, _ = search_functions.search(entry, gradient, dtype, random, 128)
        assert worst <= 1.0, (gradient, place)


def test_the_study_of_jit_sees_one_wrong_row(monkeypatch):
    (case, *_) = jit_study.cases(lambda name: name == "approximate.real_index")
    plain = jit_study.compiled

    def wrong(program, arguments):
        found = plain(program, arguments)
        found[90] *= 1.0 + 1e-12
        return found

    def shares(sizes):
        ((_, _, of_values, _, _),) = jit_study.rows_of(case, np.random.default_rng(0), sizes)
        return of_values

    assert shares([100]) <= 1.0
    monkeypatch.setattr(jit_study, "compiled", wrong)
    assert shares([100]) > 100.0


def test_the_study_of_jit_reaches_the_programs_of_the_fits():
    """In a process of its own, in which it replaces what compiles before `fitting` is imported."""
    options = ["--only", "fit of plate, R and T", "--points", "100"]  # with a held parameter
    command = [sys.executable, "-m", "benchmarks.studies.jit_study", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "program problem.programs.linearised" in done.stdout


# Found by the accuracy search; R_s, R_p, the absorptions by the cosine. In total reflection by a
# thick layer dR_p was 1,130 eps of R off, as what is left of the derivative of r; behind a rough
# film in front of a medium of small index it was 163, and that of the absorption 548.
BY_THE_COSINE = {
    "stack of a thick layer": (
        0.9877349978502398, 1.788817596321981, 0.27438533973883916, 3.5059354584830683e-09,
        0.21091259793981826, 1.371152125674556e-06, 6197.648859719227, 0.5847139851924896,
    ),
    "stack with rough boundaries": (
        1.0, 1.1644903396881325, 3.2932872889394655, 2.2072821894056243, 0.1221850154852436,
        1.5060399331009968e-07, 0.4284012527199969, 0.5675251494233149, 0.0014295004205669391,
        3.7679181896804296e-05,
    ),
}  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize("name", BY_THE_COSINE)
def test_derivatives_by_the_cosine(name):
    entry = FUNCTIONS[name]
    point = [jnp.asarray(x) for x in BY_THE_COSINE[name]]
    last = [0.0 * x for x in point[1:]]

    def results(*arguments):
        return jnp.stack([jnp.real(z) for z in entry.function(*arguments)])

    found = jax.jit(lambda *p: jax.jvp(results, p, (jnp.ones(()), *last))[1])(*point)
    with gmpy2.context(CONTEXT):
        exact = [gmpy2.mpfr(x) for x in BY_THE_COSINE[name]]
        step = gmpy2.mpfr(2) ** -250
        above, below = (entry.truth(exact[0] + s * step, *exact[1:]) for s in (1, -1))
        slopes = [
            float(gmpy2.mpc((a - b) / (2 * step)).real)
            for (a, _), (b, _) in zip(above, below, strict=True)
        ]
    np.testing.assert_allclose(found, slopes, rtol=64 * 2.2e-16, atol=64 * 2.2e-16)


@pytest.mark.study
def test_absorption_of_evanescent_light_in_front_of_a_guided_mode():
    """A_s of a thick layer beyond its critical angle, by the index of the film behind it: formed
    from losses that cancel, the derivative was 2e5 eps off."""
    point = (
        0.27195480088483825, 1.2462188818836761, 0.10148027517271158, 0.0008591158391507217,
        3.7214942789298, 0.003191807001861581, 0.2347193409738693, 1.7894501767870487e-05,
        0.3277930660925428, 0.4455723070664177, 0.7478484791328308,
    )  # fmt: skip
    (ours, truth), by, result = incoherent((False, True)), 4, 4  # the film's index; A_s in front

    def absorbed(x):
        return ours(*map(jnp.asarray, (*point[:by], x, *point[by + 1 :])))[result]

    found = jax.jit(lambda x: jax.jvp(absorbed, (x,), (1.0,))[1])(point[by])
    with gmpy2.context(CONTEXT):
        exact, step = [gmpy2.mpfr(x) for x in point], gmpy2.mpfr(2) ** -250
        above, below = (
            truth(*exact[:by], exact[by] + s * step, *exact[by + 1 :])[result][0] for s in (1, -1)
        )
        slope = float((above - below) / (2 * step))
    np.testing.assert_allclose(found, slope, rtol=64 * 2.2e-16)


@pytest.mark.study
def test_thick_layers_at_grazing_incidence_beside_a_guided_mode():
    """T and all absorptions there were 2,600 eps off, by the common factor 1 / (1 - R' P^2 R):
    what a film between the layers loses was formed as the difference of 1 - R and T."""
    point = (
        8.213136451012596e-06, 1.9468130738366614, 2.943165779858516, 6.990683974602658e-06,
        1.9032293435036944, 2.0374365195553568e-08, 2.160849682318816, 7.09815289872745e-09,
        0.25710041455222715, 4.2170479596996066e-05, 0.673174308299202, 0.08037817137685536,
        1.5975997333230112, 1.8410652621127068,
    )  # fmt: skip
    ours, truth = incoherent((False, True, False))
    with gmpy2.context(CONTEXT):
        wanted = [float(v) for v, _ in truth(*map(gmpy2.mpfr, point))]
    np.testing.assert_allclose(ours(*map(jnp.asarray, point)), wanted, rtol=16 * 2.2e-16)


# Found by the jit study (seed 20261130). T_s was 1.1e6 eps off, and 1,150 are its due, since one
# eps of each argument changes it by 3,100. In the other stack the waves that go forward grow: R_s
# and r_s were 200 to 580 eps off.
BY_THE_JIT_STUDY = {
    "stack of two thick layers around a film": (
        0.6704001395750396, 1.167874660712592, 0.37641523676240557, 3.74174858033556e-08,
        3.924744479021469, 2.6796015152399584e-05, 0.38360532121061447, 0.0015271521520082072,
        2.638741706243037, 1.0190161985512833e-06, 7.678344479821031, 0.025413138574331653,
        1.894364877460869, 1.5228221168518932,
    ),
    "stack of one layer behind an absorbing medium": (
        0.5846399037984219, 1.6326536945801124, 1.9809544096822806, 0.2390756588256415,
        4.617136486187875e-07, 0.144844104453873, 1.1508040599922317e-05, 0.3500644855617729,
        0.30671925428014185,
    ),
}  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize("name", BY_THE_JIT_STUDY)
def test_values_of_stacks(name):
    columns = np.array(BY_THE_JIT_STUDY[name])[:, None]
    assert search_functions.errors(FUNCTIONS[name], False, columns, np.float64)[0] <= 16.0

# Every target makes the environment that it needs, in .venv; only CPython >= 3.11 and pip are assumed.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo docs notebooks test test-all test-docs quick test-studies lint accuracy accuracy-search jit-study advisor-study bench stability startup first-choose fit-study fit-coverage model-coverage model-study model-success errors-study misfit-study nist-study film-study film-coverage free-film-study film-models film-choice bench-maps fuzz matrix gpu clean

demo: .venv/installed-plot  ## fit the two scans that ship with the project; tables, pictures, JSON in demo/
	mkdir -p demo
	$(BIN)/fresnel-fit examples/data/germanium_633nm_simulated.csv --plot demo/germanium.png --json demo/germanium.json
	$(BIN)/fresnel-fit examples/data/gold_532nm.csv --plot demo/gold.png --json demo/gold.json

docs: .venv/installed-docs  ## the documentation site in build/site, strictly: a warning is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

notebooks: .venv/installed-test  ## the tutorials as notebooks, in examples/notebooks
	$(BIN)/python examples/notebooks/make.py

test: .venv/installed-test  ## the tests but for the slowest files (six to eight minutes on 2 cores)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow and not study and not docs"

test-all: .venv/installed-test  ## all tests, the slowest files too (about thirteen minutes)
	$(BIN)/python -m pytest -n 2 --dist loadfile

test-docs: .venv/installed-test .venv/installed-docs  ## that docs and examples run and print what is shown, and the benchmarks measure what they say
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "docs and not study"

# Of each room of `fitting` and each part of `fresnel_jax`: two minutes of processor time.
QUICK := arithmetic cli_outputs covariance directions dispersion_calls fit half_vector header_names \
	interface_compiled last_steps measurement model_refusals noise_and_misfit numbers \
	order_of_residuals penetration_depth predictions progress reader_refusals reading rooms shapes \
	stack_failures structures table trials

quick: .venv/installed-test  ## a minute of tests of every part, for work in progress
	$(BIN)/python -m pytest -n 2 --dist loadfile $(wildcard $(QUICK:%=tests/*/test_%.py))

test-studies: .venv/installed-test  ## the larger studies, and further cases of what `make test` proves (an hour)
	$(BIN)/python -m pytest -n 2 -m study

lint: .venv/installed-test .venv/installed-lint  ## linters and type checker
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

accuracy: .venv/installed-test  ## two tables of docs/accuracy.md (three minutes)
	$(BIN)/python -m benchmarks.accuracy.interface

accuracy-search: .venv/installed-test  ## search for the largest errors; e.g. SEARCH="--seed 1 --minutes 60"
	$(BIN)/python -m benchmarks.accuracy.search $(or $(SEARCH),--minutes 10)

jit-study: .venv/installed-test  ## whether jit changes a result, of functions and fits (hours; e.g. STUDY="--skip stack --points 40000")
	$(BIN)/python -m benchmarks.studies.jit_study $(STUDY)

SCENES ?= 20
advisor-study: .venv/installed-test  ## what the scene advisor states, by brute force over all scenes, SCENES of them random
	FRESNEL_SCENES=$(SCENES) $(BIN)/python -m pytest -q -m "study or not study" tests/docs/test_advisor.py

bench: .venv/installed-bench  ## speed against accuracy: docs/benchmarks, and the tables of docs (10 minutes)
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.speed.many_points --out docs/benchmarks
	$(BIN)/python -m benchmarks.speed.fit_throughput --out docs/benchmarks
	$(BIN)/python -m benchmarks.speed.operations
	$(BIN)/python -m benchmarks.speed.tiers
	$(BIN)/python -m benchmarks.speed.losses
	$(BIN)/python -m benchmarks.speed.stacks --out docs/benchmarks

bench-maps: .venv/installed-bench .venv/installed-maps  ## maps on disk: rates, workers, memory, films (five minutes)
	$(BIN)/python -m benchmarks.speed.maps

stability: .venv/installed-bench  ## where each method fails: table and picture in docs/stability
	$(BIN)/python -m benchmarks.stability
	$(BIN)/python -m benchmarks.stability.stack_failures

startup: .venv/installed-plot  ## where the time of the command fresnel-fit goes
	$(BIN)/python -m benchmarks.speed.startup

first-choose: .venv/installed-bench  ## seconds of a first choose, when nothing is compiled yet (a quarter of an hour)
	$(BIN)/python -m benchmarks.speed.first_choose

CURVES ?= 1000000
fit-study: .venv/installed-bench  ## how often the fit finds the best minimum, over measurements drawn at random (an hour; CURVES=100000 for five minutes)
	$(BIN)/python -m benchmarks.studies.fit_success --curves $(CURVES) --out docs/benchmarks

fit-coverage: .venv/installed-bench  ## how often the 95 % intervals hold the truth, over 1e4 repeats
	$(BIN)/python -m benchmarks.studies.fit_coverage

model-coverage: .venv/installed-bench  ## the same of the intervals of model fits (half an hour)
	$(BIN)/python -m benchmarks.studies.model_coverage

errors-study: .venv/installed-bench  ## what 95 % intervals hold where stated errors are not the errors
	$(BIN)/python -m benchmarks.studies.errors_study

TRUTHS ?= 3
misfit-study: .venv/installed-bench  ## whether fits of a sample that is not the true one are told, and what their intervals hold (an hour)
	$(BIN)/python -m benchmarks.studies.misfit_study --truths $(TRUTHS)

nist-study: .venv/installed-bench  ## digits of NIST's certified values that fits from one start reach (three minutes)
	$(BIN)/python -m benchmarks.studies.nist_study

model-study: .venv/installed-bench  ## how often --sample auto finds the true model, and adds none too many
	$(BIN)/python -m benchmarks.studies.model_choice

model-success: .venv/installed-bench  ## how often a model fit reaches the best minimum (half an hour)
	$(BIN)/python -m benchmarks.studies.model_success --truths 20

# more, and others: make fuzz FUZZ=1000000 SEED=7
FUZZ ?= 100000
SEED ?= 0
fuzz: .venv/installed-test  ## files of known truth, damaged files, kills: none misread, none lost (half an hour)
	$(BIN)/python -m benchmarks.studies.fuzz_meaning $(FUZZ) $(SEED)
	$(BIN)/python -m benchmarks.studies.fuzz_reader $(FUZZ) $(SEED)
	FRESNEL_KILLS=300 $(BIN)/python -m pytest -q tests/output/test_outputs.py

FILMS ?= 10000
film-study: .venv/installed-bench  ## how often the right thickness of a film is found (hours; goes on where the last run ended)
	$(BIN)/python -m benchmarks.studies.film_success --films $(FILMS) --rows docs/benchmarks/film_success.csv

film-coverage: .venv/installed-bench  ## how often the 95 % intervals of films hold the true thickness, eta and k (half an hour)
	$(BIN)/python -m benchmarks.studies.film_coverage

free-film-study: .venv/installed-bench  ## how often the interval of the thickness of a film with a free index holds the true one (an hour)
	$(BIN)/python -m benchmarks.studies.free_film_study

film-models: .venv/installed-bench  ## how often choose takes the true model of a film of unknown thickness (an hour)
	$(BIN)/python -m benchmarks.studies.film_models

film-choice: .venv/installed-bench  ## how often choose takes the true one of several films, and adds no layer (hours)
	$(BIN)/python -m benchmarks.studies.film_choice

MATRIX ?=
matrix:  ## the built wheel, the tests and the README's commands with the oldest and newest versions (hours; MATRIX="--without-make-test PYTHON ...")
	$(PYTHON) .ci/matrix.py $(MATRIX)

gpu: .venv/installed-bench .venv/installed-test  ## bounds and speed on the device that jax finds; on a GPU in under ten minutes
	$(BIN)/python -m benchmarks.speed.device

.venv/installed-%: pyproject.toml
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[$*]'
	touch $@

clean:
	rm -rf .venv demo

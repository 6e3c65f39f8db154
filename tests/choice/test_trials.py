"""Which candidates of a choice are tried, and how thoroughly."""

from dataclasses import replace
from typing import Any

import pytest

from fitting.choice import selection as select
from fitting.choice.candidates import Key
from fitting.choice.trials import Trials
from fitting.results.result_parts import UNDETERMINED
from tests.estimates import outcome


def test_a_chain_ends_with_a_candidate_that_may_not_be_taken():
    fitted = []

    def run(key, thorough) -> Any:
        fitted.append(key.model)
        return replace(outcome(1, 0.0), status=UNDETERMINED)

    trials = Trials(run, lambda label: None, "auto")
    first, second, other = map(Key, ("drude-lorentz:1", "drude-lorentz:2", "tauc-lorentz:1"))
    trials.attempt_chains([first, second], [other])
    assert sorted(fitted) == ["drude-lorentz:1", "tauc-lorentz:1"]
    trials.attempt_chains([first, second], [other])
    assert len(fitted) == 2  # none is fitted twice


def test_what_may_be_taken_is_searched_thoroughly_until_that_changes_nothing():
    # BIC after the first stages, and after a thorough search
    bic = {"drude": (100.0, 90.0), "lorentz:1": (0.0, 0.0), "lorentz:2": (20.0, -50.0),
           "lorentz:3": (28.0, 28.0), "constant": (40.0, -999.0)}  # fmt: skip
    asked, told = [], []

    def run(key, thorough) -> Any:
        asked.append((key.model, thorough))
        return outcome(2, bic[key.model][thorough])

    trials = Trials(run, told.append, "auto")
    trials.attempt(*map(Key, bic))
    assert trials.best().label == "lorentz:1"
    trials.settle()
    assert trials.best().label == "lorentz:2"
    again = [model for model, thorough in asked if thorough]
    assert sorted(again) == ["lorentz:1", "lorentz:2", "lorentz:3"]
    assert told[-1].endswith(", searched thoroughly")


def test_the_candidates_with_most_parameters_are_searched_first():
    sizes, told = {"drude": 2, "lorentz:2": 7, "lorentz:1": 4}, []
    trials = Trials(lambda key, thorough: outcome(sizes[key.model], 0.0), told.append, "auto")
    trials.attempt(*map(Key, sizes))
    trials.settle()
    assert [label.partition(",")[0] for label in told[3:]] == ["lorentz:2", "lorentz:1", "drude"]


@pytest.mark.parametrize("key, begun", [
    (Key("lorentz:3"), "lorentz:2"), (Key("drude-lorentz:1"), None), (Key("cauchy:3"), None),
    (Key("constant", ("scale",), True), "constant, k = 0"),
    (Key("drude", ("scale", "angle_offset")), "drude, scale"),
])  # fmt: skip
def test_which_candidate_another_one_begins_from(key, begun):
    assert select._begun_from(key) == begun


def test_a_fourth_oscillator_is_tried_only_where_the_third_of_its_kind_helped():
    bic = {"lorentz:1": 100.0, "lorentz:2": 0.0, "lorentz:3": -5.0, "drude-lorentz:1": 100.0,
           "drude-lorentz:2": 50.0, "drude-lorentz:3": -50.0}  # fmt: skip

    def run(key, thorough) -> Any:
        return outcome(5, bic.get(key.model, 200.0))

    trials = Trials(run, lambda label: None, "auto")
    select._stages(trials, 40)
    fourth = [key.model for key in trials.tried if key.model.endswith(":4")]
    assert fourth == ["drude-lorentz:4"]

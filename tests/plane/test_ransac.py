"""The robust loop on a problem without geometry: it knows when it must stop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.plane.ransac import RansacOptions, ransac


class Mock:
    """Models are numbers; proposal number k (from 1) is worth `worth[k]`, 1 where not named.

    refined: what refining adds to a model. rate: the success rate that the problem states.
    """

    def __init__(self, worth, *, refined=0.0, rate=0.0):
        self.worth, self.refined, self.rate = worth, refined, rate
        self.proposed, self.scored, self.refines, self.rates = 0, 0, [], []

    def propose(self, count, rng):
        start = self.proposed + 1
        self.proposed += count
        return [self.worth.get(k, 1.0) for k in range(start, start + count)]

    def score(self, models):
        self.scored += len(models)
        return np.array(models, dtype=float)

    def refine(self, model):
        self.refines.append(model)
        return model + self.refined

    def success_rate(self, model):
        self.rates.append(model)
        return self.rate(model) if callable(self.rate) else self.rate


def run(problem, **options):
    return ransac(problem, RansacOptions(**options), np.random.default_rng(0))


def needed(rate, confidence):
    """Draws n after which (1 - rate)^n <= 1 - confidence, by counting."""
    n, missed = 0, 1.0
    while missed > (1.0 - confidence) * (1 + 1e-9):
        n, missed = n + 1, missed * (1.0 - rate)
    return n


@pytest.mark.parametrize("confidence", [0.9, 0.99, 0.999])
@pytest.mark.parametrize("rate", [0.9, 0.5, 0.1, 0.02])
def test_stops_when_a_good_proposal_was_drawn_with_the_confidence(rate, confidence):
    result = run(Mock({1: 5.0}, rate=rate), confidence=confidence, max_proposals=100_000, batch=1)
    assert result.proposals <= needed(rate, confidence)
    problem = Mock({1: 5.0}, rate=rate)
    assert run(problem, confidence=confidence, max_proposals=100_000, batch=1).score == 5.0
    assert problem.proposed == needed(rate, confidence)


@pytest.mark.parametrize(("batch", "maximum", "expected"), [(1, 7, 7), (5, 7, 10), (100, 300, 300)])
def test_hopeless_search_ends_at_the_maximum_rounded_up_to_batches(batch, maximum, expected):
    problem = Mock({}, rate=0.0)
    run(problem, max_proposals=maximum, batch=batch)
    assert problem.proposed == expected


def test_certain_success_ends_after_one_batch():
    problem = Mock({3: 2.0}, rate=1.0)
    result = run(problem, max_proposals=1000, batch=10)
    assert (problem.proposed, result.model, result.proposals) == (10, 2.0, 10)


def test_nothing_with_support_is_none():
    problem = Mock(dict.fromkeys(range(1, 41), 0.0))
    assert run(problem, max_proposals=40, batch=10) is None
    assert problem.proposed == 40
    assert problem.refines == []


def test_a_later_better_model_wins_and_shortens_the_search():
    rates = {2.0: 0.001, 9.0: 0.5}
    problem = Mock({1: 2.0, 50: 9.0}, rate=rates.get)
    result = run(problem, confidence=0.99, max_proposals=10_000, batch=10)
    assert (result.model, result.proposals) == (9.0, 50)
    assert problem.proposed == 50  # ten draws suffice at one half, and fifty were made
    assert problem.rates == [2.0, 9.0]


def test_a_better_model_of_lower_rate_does_not_prolong_the_search():
    rates = {2.0: 0.2, 9.0: 1e-9}
    problem = Mock({1: 2.0, 2: 9.0}, rate=rates.get)
    run(problem, confidence=0.99, max_proposals=100_000, batch=1)
    assert problem.proposed == needed(0.2, 0.99)


def test_only_new_bests_are_refined():
    problem = Mock({1: 2.0, 5: 3.0, 6: 3.0, 9: 2.5}, rate=0.0)
    run(problem, max_proposals=20, batch=1)
    assert problem.refines == [2.0, 3.0]


@pytest.mark.parametrize(("gain", "kept"), [(0.5, 4.5), (0.0, 4.0), (-0.5, 4.0)])
def test_refining_is_kept_only_if_it_did_not_lower_the_score(gain, kept):
    result = run(Mock({1: 4.0}, refined=gain, rate=1.0), max_proposals=10, batch=1)
    assert (result.model, result.score) == (kept, kept)


def test_proposal_count_is_where_the_best_was_found():
    result = run(Mock({24: 7.0}, rate=0.0), max_proposals=50, batch=10)
    assert result.proposals == 30


class Bernoulli:
    """Proposals are good with a known chance; what is stated is that chance."""

    def __init__(self, rate):
        self.rate, self.proposed = rate, 0

    def propose(self, count, rng):
        self.proposed += count
        return list(np.where(rng.random(count) < self.rate, 2.0, 1.0))

    def score(self, models):
        return np.array(models)

    def refine(self, model):
        return model

    def success_rate(self, model):
        return self.rate


def test_confidence_is_kept_in_the_long_run():
    runs, confidence, rate = 2000, 0.9, 0.05
    options = RansacOptions(confidence=confidence, max_proposals=10_000, batch=1)
    found = sum(
        ransac(Bernoulli(rate), options, np.random.default_rng([7, k])).model == 2.0
        for k in range(runs)
    )
    slack = 3.3 * math.sqrt(confidence * (1 - confidence) / runs)
    assert abs(found / runs - confidence) < slack + rate * (1 - confidence)


def test_same_seed_same_draws():
    options = RansacOptions(confidence=0.5, max_proposals=400, batch=20)
    counts = []
    for seed in (1, 1, 2, 3, 4):
        problem = Bernoulli(0.01)
        result = ransac(problem, options, np.random.default_rng(seed))
        counts.append((problem.proposed, result.proposals, result.model))
    assert counts[0] == counts[1]
    assert len(set(counts)) > 1


def test_any_support_counts():
    assert run(Mock({3: 0.2}, rate=1.0), max_proposals=5, batch=5).score == 1.0
    weak = Mock(dict.fromkeys(range(1, 6), 0.01), rate=1.0)
    assert run(weak, max_proposals=5, batch=5).score == 0.01

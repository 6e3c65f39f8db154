"""Work in threads: as many as there are processors, and the results in order."""

import threading

import pytest

from fitting.process import side_by_side as threads


def test_results_come_in_order_from_threads_side_by_side(monkeypatch):
    monkeypatch.setattr(threads, "PROCESSORS", 4)
    all_here = threading.Barrier(2, timeout=30.0)

    def one(x):
        all_here.wait()
        return x

    assert threads.side_by_side(one, [3, 1]) == [3, 1]


def test_a_single_piece_of_work_stays_in_its_thread():
    assert threads.side_by_side(lambda x: threading.current_thread(), [0]) == [
        threading.current_thread()
    ]


def test_work_that_fails_raises(monkeypatch):
    monkeypatch.setattr(threads, "PROCESSORS", 4)
    with pytest.raises(ZeroDivisionError):
        threads.side_by_side(lambda x: 1 / x, [1, 0])

"""What is told of work that takes long, by a clock that is set by hand."""

import pytest

from pneunet.base.system import progress as told


class Clock:
    now = 100.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch, caplog):
    caplog.set_level("INFO", "pneunet")
    clock = Clock()
    monkeypatch.setattr(told, "time", clock)
    return clock


def work(clock, items, seconds, **total):
    out = []
    for item in told.progress(items, "parts", **total):
        clock.now += seconds
        out.append(item)
    return out


def test_work_that_takes_long_says_when_it_will_be_done(clock, caplog):
    assert work(clock, iter("abcd"), 1.5, total=4) == list("abcd")
    assert caplog.messages == ["2 of 4 parts, 3 s, ETA 3 s"]
    caplog.clear()
    assert work(clock, range(100), 0.01) == list(range(100))
    assert caplog.messages == []


def test_the_pace_of_parts_that_are_not_alike(clock):
    pace = told.Pace()
    clock.now += 6
    assert pace.left(0.75) == "; ETA 2 s" and told.eta(10, 0.25) == "ETA 30 s"
    pace = told.Pace()
    clock.now += 0.1
    assert pace.left(0.5) == ""

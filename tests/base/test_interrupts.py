"""Signals: the first is kept for an end in order, the second ends at once."""

import signal

import pytest

from pneunet.base.system.interrupts import SAME_SECONDS, deferred, is_interrupted


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_second_signal_does_not_wait(number):
    with pytest.raises(KeyboardInterrupt), deferred():
        assert not is_interrupted()
        for _ in range(2):  # timeout and its like send one signal twice
            signal.raise_signal(number)
            assert is_interrupted()
        signal.getsignal(number).first -= 2 * SAME_SECONDS
        with deferred():  # one block with the outer one
            signal.raise_signal(number)
        pytest.fail("the second signal was kept, too")
    assert not is_interrupted()

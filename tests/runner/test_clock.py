"""What the clock says of a call."""

import gc
import threading
import time

import pytest

from regbench.runner.clock import Clock


def test_a_sleep_takes_wall_time_and_no_cpu_time():
    with (clock := Clock()):
        time.sleep(0.05)
    assert clock.measurement.time_ms >= 50
    assert clock.measurement.cpu_ms < 25


def test_work_takes_cpu_time():
    with (clock := Clock()):
        end = time.process_time() + 0.05
        while time.process_time() < end:
            pass
    assert clock.measurement.cpu_ms >= 50


def test_the_peak_is_of_this_call():
    with (clock := Clock()):
        kept = bytearray(200_000_000)
    high = clock.measurement.peak_rss_mb
    del kept
    with (clock := Clock()):
        pass
    assert high > clock.measurement.peak_rss_mb + 150


def test_threads_that_ran_are_counted():
    go, stop = threading.Event(), threading.Event()

    def work():
        go.wait()
        sum(range(300_000))
        stop.wait()

    others = [threading.Thread(target=work) for _ in range(3)]
    for other in others:
        other.start()
    with (clock := Clock()):
        go.set()
        time.sleep(0.2)
    stop.set()
    for other in others:
        other.join()
    assert clock.measurement.threads_ran >= 4


def test_the_collector_is_off_inside_and_on_after_also_when_the_call_raises():
    clock = Clock()
    seen = []

    def call():
        with clock:
            seen.append(gc.isenabled())
            raise RuntimeError

    with pytest.raises(RuntimeError):
        call()
    assert seen == [False]
    assert gc.isenabled()
    assert clock.measurement.time_ms >= 0


def test_the_device_is_synchronised_on_both_sides():
    calls = []
    with Clock(lambda: calls.append(len(calls))):
        assert calls == [0]
    assert calls == [0, 1]

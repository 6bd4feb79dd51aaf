"""Every polite way to stop a command is Ctrl-C: a scheduler's SIGTERM and a closed terminal too."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def any_stop_as_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt for SIGTERM and SIGHUP, so that workers and all they started are killed.

    A signal that is ignored (nohup) stays so.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    stops = [number for number, handler in before.items() if handler is signal.SIG_DFL]
    for number in stops:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in stops:
            signal.signal(number, signal.SIG_DFL)

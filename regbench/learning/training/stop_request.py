"""Ctrl-C, SIGTERM and SIGHUP as a request: the step is finished and saved before the training ends."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequest:
    """Remembers the first signal; a second one ends the process at once, and the last checkpoint stands.

    Attributes:
        signal: The number of the signal that came, or None.
    """

    def __init__(self) -> None:
        self.signal: int | None = None
        self._before: dict[int, Any] = {}

    def listen(self) -> None:
        """Take over the signals, again if another has taken them since. One that is ignored (nohup) stays so."""
        for number in SIGNALS:
            before = self._before.setdefault(number, signal.getsignal(number))
            if before is not signal.SIG_IGN and self.signal is None:
                signal.signal(number, self._remember)

    def restore(self) -> None:
        """Give the signals back to whom they belonged."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}

    def _remember(self, number: int, frame: FrameType | None) -> None:
        self.signal = number
        for each, before in self._before.items():
            if before is not signal.SIG_IGN:
                signal.signal(each, signal.SIG_DFL)

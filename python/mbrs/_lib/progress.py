"""One updating line on standard error, drawn by rich, for work that takes longer than a second."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.live import Live

_QUIET_FOR = 1.0
_EVERY = 0.1
# Operations that take some tenths of a second.
_LONG = 1e8


class Progress:
    """Shows ``label  42 % (420/1000), 3 s left`` once the work has lasted a second; silent otherwise.

    It writes only where standard error is a terminal or ``MBRS_PROGRESS=1`` is set (``MBRS_PROGRESS=0`` silences it),
    and never raises because of the terminal. O(1) per `advance`.

    Parameters
    ----------
    label
        What is being done.
    total
        Number of steps, or None where it is not known beforehand.
    stream, clock
        Where to write and what tells the time in seconds; for tests.
    always
        True shows it at once and wherever standard error goes, False never, None as said above.

    Examples
    --------
    >>> with Progress("frequencies", 3) as progress:
    ...     for f in (1.0, 2.0, 3.0):
    ...         progress.advance(note=f"{f:.1f} Hz")
    >>> progress.done
    3
    """

    def __init__(
        self,
        label: str,
        total: int | None = None,
        *,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
        always: bool | None = None,
    ) -> None:
        self.label = label
        self.total = total
        self.done = 0
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._start = clock()
        self._last = -float("inf")
        self._live: Live | None = None
        self._enabled = _wanted(self._stream) if always is None else always
        self._quiet = 0.0 if always else _QUIET_FOR

    def __enter__(self) -> Progress:
        self._start = self._clock()
        return self

    @property
    def due(self) -> bool:
        """True if the next `advance` would write, for notes that cost something."""
        now = self._clock()
        return self._enabled and now - self._start >= self._quiet and now - self._last >= _EVERY

    @property
    def rate(self) -> float:
        """Steps per second so far."""
        return self.done / max(self._clock() - self._start, 1e-9)

    def advance(self, steps: int = 1, note: str = "") -> None:
        """Count ``steps`` as done; ``note`` is shown behind the line (a frequency, a residual)."""
        self.done += steps
        if not self._enabled:
            return
        now = self._clock()
        if now - self._start >= self._quiet and now - self._last >= _EVERY:
            self._last = now
            self._show(self._line(now - self._start, note))

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            with suppress(OSError, ValueError):
                self._live.stop()

    def _line(self, elapsed: float, note: str) -> str:
        if self.total:
            share = min(self.done / self.total, 1.0)
            text = f"{self.label}  {100.0 * share:3.0f} % ({self.done}/{self.total})"
            if 0.0 < share < 1.0:
                text += f", {_duration(elapsed * (1.0 - share) / share)} left"
        else:
            text = f"{self.label}  {self.done}, {_duration(elapsed)}"
        return text + (f"  {note}" if note else "")

    def _show(self, line: str) -> None:
        """The line, cut at the width of the terminal; rich takes it away at the end."""
        from rich.console import Console
        from rich.live import Live
        from rich.text import Text

        text = Text(line, no_wrap=True, overflow="ellipsis")
        try:
            if self._live is None:
                where = Console(file=self._stream, force_terminal=True, force_jupyter=False)
                self._live = Live(
                    console=where, transient=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
                )
                self._live.start()
            self._live.update(text, refresh=True)
        except (OSError, ValueError):  # the stream is gone
            self._enabled = False


class Elapsed(Progress):
    """Shows ``label  12 s`` while one call that cannot count its steps lasts longer than a second.

    A thread of its own keeps the line up to date; it exists only where the line would be shown.

    Examples
    --------
    >>> with Elapsed("lowest modes"):
    ...     sum(range(1000))
    499500
    """

    def __enter__(self) -> Elapsed:
        super().__enter__()
        self._over = threading.Event()
        self._ticker = threading.Thread(target=self._tick, daemon=True) if self._enabled else None
        if self._ticker is not None:
            self._ticker.start()
        return self

    def _tick(self) -> None:
        while not self._over.wait(_EVERY):
            self.advance(0)

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        if self._ticker is not None:
            self._ticker.join()
        super().__exit__(kind, value, trace)

    def _line(self, elapsed: float, note: str) -> str:
        return f"{self.label}  {_duration(elapsed)}"


def _wanted(stream: TextIO) -> bool:
    asked = os.environ.get("MBRS_PROGRESS", "")
    if asked in ("0", "1"):
        return asked == "1"
    try:
        return stream.isatty()
    except (AttributeError, ValueError):
        return False


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


def call_progress(label: str, work: float) -> AbstractContextManager[Any]:
    """`Elapsed` for work of that many operations, nothing where it is over before anyone could look."""
    return Elapsed(label) if work > _LONG else nullcontext()

"""How far some work is: as a bar in a notebook, as a line on standard error elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from html import escape
from typing import Any, Union

Listener = Callable[[str, int, Union[int, None]], Any]
Progress = Union[bool, Listener, None]
"""`True` shows how far the work is; a function is given what is done, how much of it, and of how much where that is known."""

_BETWEEN_S = 0.1


class Followed:
    """Passes progress on, and says when the work is over."""

    def __init__(self, show: Listener, is_ours: bool) -> None:
        self._show, self._is_ours = show, is_ours
        self._last: tuple[str, int, int | None] | None = None
        self._shown = 0.0

    def __call__(self, what: str, done: int, total: int | None) -> None:
        before, self._last = self._last, (what, done, total)
        now = time.monotonic()
        # Of what this package shows itself: what is new, what is whole, and of the rest some ten a second.
        if self._is_ours and before and before[0] != what and before[1] != before[2]:
            self._show(before[0], before[1], before[1])
        if not self._is_ours or before is None or before[0] != what or now - self._shown >= _BETWEEN_S or done == total:
            self._shown = now
            self._show(what, done, total)

    def end(self, well: bool) -> None:
        """What was done is all of it, where the work went well. A line on standard error ends however it went."""
        if self._last is None or self._last[1] == self._last[2]:
            return
        what, done, _ = self._last
        if well:
            self._show(what, done, done)
        elif self._show is _line:
            sys.stderr.write("\n")


def followed(progress: Progress) -> Followed | None:
    """The function that takes progress."""
    if callable(progress):
        return Followed(progress, False)
    return Followed(_bar() if _in_notebook() else _line, True) if progress else None


def _in_notebook() -> bool:
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


def _line(what: str, done: int, total: int | None) -> None:
    of = f" of {total:,}" if total and total != done else ""
    sys.stderr.write(f"\r{what}: {done:,}{of}   " + ("\n" if done == total else ""))
    sys.stderr.flush()


def _bar() -> Listener:
    display = sys.modules["IPython"].display
    handle = display.display(display.HTML(""), display_id=True)

    def show(what: str, done: int, total: int | None) -> None:
        if done == total:
            bar = f"<progress value='1' max='1'></progress> {escape(what)}: {done:,}, done"
        else:
            bar = f"<progress value='{done}' max='{total}'></progress>" if total else "<progress></progress>"
            bar += f" {escape(what)}: {done:,}" + (f" of {total:,}" if total else "")
        handle.update(display.HTML(bar))

    return show

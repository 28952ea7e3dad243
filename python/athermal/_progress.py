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


def listener(progress: Progress) -> Listener | None:
    """The function that takes progress."""
    if callable(progress):
        return progress
    if not progress:
        return None
    return _seldom(_bar() if _in_notebook() else _line)


def _in_notebook() -> bool:
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


def _seldom(show: Listener) -> Listener:
    """Shows what is new, what is whole, and of the rest some ten a second."""
    last: tuple[str, float] = ("", 0.0)

    def of(what: str, done: int, total: int | None) -> None:
        nonlocal last
        now = time.monotonic()
        if what != last[0] or now - last[1] >= _BETWEEN_S or done == total:
            last = (what, now)
            show(what, done, total)

    return of


def _line(what: str, done: int, total: int | None) -> None:
    of = f" of {total:,}" if total else ""
    sys.stderr.write(f"\r{what}: {done:,}{of}   " + ("\n" if done == total else ""))
    sys.stderr.flush()


def _bar() -> Listener:
    display = sys.modules["IPython"].display
    handle = display.display(display.HTML(""), display_id=True)

    def show(what: str, done: int, total: int | None) -> None:
        bar = f"<progress value='{done}' max='{total}'></progress>" if total else "<progress></progress>"
        of = f" of {total:,}" if total else ""
        handle.update(display.HTML(f"{bar} {escape(what)}: {done:,}{of}"))

    return show

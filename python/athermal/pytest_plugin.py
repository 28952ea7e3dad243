"""What the package brings to pytest."""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture
def athermal_conforms() -> Callable[..., None]:
    """Fails where a node that is written in Python breaks a rule that every node keeps: `athermal_conforms(MyNode, Case(...))`."""
    # Only who asks for it loads the package.
    from athermal.conformance import conforms

    return conforms

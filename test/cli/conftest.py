"""Commands that start nodes in this process meet no other run: not of a user, nor of a worker."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import running


@pytest.fixture(scope='module', autouse=True)
def own_network() -> Iterator[None]:
    """A router port and a domain that nobody else uses."""
    own = running.environment()
    with pytest.MonkeyPatch.context() as patch:
        for name in ('MECHANISM_SIM_ROUTER', 'ROS_DOMAIN_ID'):
            patch.setenv(name, own[name])
        yield

"""Fixtures of tests of nodes."""

from __future__ import annotations

import pytest
import running


@pytest.fixture
def ros(monkeypatch) -> dict[str, str]:
    """Environment of processes on rclpy and rclcpp, in a domain of their own."""
    monkeypatch.setattr(running, 'middleware', 'rclpy')
    return running.environment()

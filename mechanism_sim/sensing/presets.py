"""Instruments by name: the keys of a sensor in a scene that make up each of them."""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {}
"""What a scene would have to say of ``sensors.NAME`` to get the instrument."""

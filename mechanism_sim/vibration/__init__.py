"""Vibration: parts on springs, their frequencies and modes, and how they respond."""

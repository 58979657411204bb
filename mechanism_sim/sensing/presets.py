"""Instruments by name: the keys of a sensor in a scene that make up each of them.

What data sheets say and what is assumed is told apart in docs/measurement.md.
"""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # [SB] 7.2: Brüel & Kjær accelerometer 4371, conditioning amplifier 2635 and a 12-bit converter
    # of a PDP-11/03, at 10 mV per m/s^2
    'bk4371_bk2635': {
        'sample_rate': '2.7 kHz',
        'gravity': True,
        'transducer': {'natural_frequency': '42 kHz', 'damping_ratio': 0.02, 'transverse': 0.02},
        'amplifier': {
            'high_pass': '2 Hz',
            'high_pass_order': 1,
            'low_pass': '1 kHz',
            'low_pass_order': 2,
        },
        'adc': {'range': '512 m/s^2', 'bits': 12},
    },
    # a piezoelectric accelerometer with built-in electronics of 100 mV/g, and a 24-bit converter
    'iepe': {
        'sample_rate': '51.2 kHz',
        'gravity': True,
        'transducer': {'natural_frequency': '50 kHz', 'damping_ratio': 0.02, 'transverse': 0.03},
        'amplifier': {'high_pass': '0.16 Hz', 'high_pass_order': 1},
        'anti_alias': {'frequency': '20 kHz', 'order': 8},
        'adc': {'range': '490 m/s^2', 'bits': 24},
        'noise': {'rms': '0.0015 m/s^2'},
    },
    # Analog Devices ADXL1005, micromechanical, and a 16-bit converter behind a 10 kHz filter
    'adxl1005': {
        'sample_rate': '51.2 kHz',
        'gravity': True,
        'transducer': {'natural_frequency': '42 kHz', 'damping_ratio': 0.02, 'transverse': 0.01},
        'amplifier': {'low_pass': '70 kHz', 'low_pass_order': 1},
        'anti_alias': {'frequency': '10 kHz', 'order': 4},
        'adc': {'range': '981 m/s^2', 'bits': 16},
        'noise': {'rms': '0.075 m/s^2'},
    },
}
"""Keys of ``sensors.NAME`` in a scene that give the instrument."""

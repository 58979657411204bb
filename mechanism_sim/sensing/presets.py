"""Instruments by name: the keys of a sensor in a scene that make up each of them.

Comments say what data sheets have and what is assumed; sheets were not checked against printed
copies.
"""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # [SB] 7.2: Brüel & Kjær accelerometer 4371, conditioning amplifier 2635 and a converter of a
    # PDP-11/03. [SB] mentions no filter before sampling but the amplifier's, and mains hum and
    # radiation without amounts; the trigger at zero crank angle is in the scene.
    'bk4371_bk2635': {
        'sample_rate': '2.7 kHz',  # [SB] 7.2, "about"
        'gravity': True,
        # mounted resonance: product data BP 0196; damping assumed, as usual for such
        # accelerometers; transverse sensitivity assumed, the data sheet allows 4 %
        'transducer': {'natural_frequency': '42 kHz', 'damping_ratio': 0.02, 'transverse': 0.02},
        'amplifier': {
            'high_pass': '2 Hz',  # assumed: one of its limits for acceleration, 0.2 and 2 Hz
            'high_pass_order': 1,
            # assumed: of its settings (0.1, 1, 3, 10, 30, 100 kHz, 12 dB an octave) the one below
            # half of the sampling rate
            'low_pass': '1 kHz',
            'low_pass_order': 2,
        },
        # 16 inputs and Schmitt triggers are those of DEC's ADV11-A and KWV11-A (manual
        # EK-ADV11-OP): 12 bits, +-5.12 V; a gain of 10 mV per m/s^2 is assumed
        'adc': {'range': '512 m/s^2', 'bits': 12},
    },
    # A piezoelectric accelerometer with built-in electronics of 100 mV/g, and a 24-bit converter:
    # typical of catalogues, of no particular sensor. 0.16 Hz is a discharge of 1 s.
    'iepe': {
        'sample_rate': '51.2 kHz',
        'gravity': True,
        'transducer': {'natural_frequency': '50 kHz', 'damping_ratio': 0.02, 'transverse': 0.03},
        'amplifier': {'high_pass': '0.16 Hz', 'high_pass_order': 1},
        'anti_alias': {'frequency': '20 kHz', 'order': 8},
        'adc': {'range': '490 m/s^2', 'bits': 24},
        'noise': {'rms': '0.0015 m/s^2'},
    },
    # Analog Devices ADXL1005 (data sheet Rev. 0), micromechanical: resonance, amplifier, range and
    # noise of 75 ug/sqrt(Hz), which is 0.075 m/s^2 behind the filter. Damping, transverse
    # sensitivity, filter and converter are assumed.
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

"""Linear vibrations ([V] chapter 6): oscillators, excitation, systems of many masses, rotors.

Closed forms; what no machine needs (responses in time, state space) is in `docs/books`.
Amplitudes are complex: A stands for Re(A e^(i w t)), so a sine of amplitude P0 is -i P0.
"""

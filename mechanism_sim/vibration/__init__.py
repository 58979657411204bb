"""Linear vibrations ([V] chapter 6): oscillators, excitation, systems of many masses, rotors.

Closed forms, and the state-space solution (`state_space`), each of which checks the other.
Amplitudes are complex: A stands for Re(A e^(i w t)), so a sine of amplitude P0 is -i P0.
"""

"""Measurements that anyone can repeat: speed against error, here and of peers.

``python -m benchmarks`` lists what there is to measure. It stands beside the package, which knows
nothing of it, and is not installed.
"""

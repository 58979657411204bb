"""Interfaces of ROS 2 (messages, services, actions): classes, CDR, type hashes, plain data.

The classes of ROS where it is installed, the same made from their definitions elsewhere; no
network is needed for either. A package of messages is found by its name, see `definitions`.
"""

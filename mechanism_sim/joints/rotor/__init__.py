"""Compliant shafts."""

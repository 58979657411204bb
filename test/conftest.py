"""Settings of all tests."""

from hypothesis import settings

# Wall time says nothing on a shared machine, and a test that fails must fail again.
settings.register_profile('house', deadline=None, derandomize=True)
settings.load_profile('house')

"""Settings of all tests."""

import os

# Before NumPy is loaded, and for all processes that tests start: threads of BLAS in several
# processes on few cores wait for each other, ten times as long as the work takes.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

from hypothesis import settings

# Wall time says nothing on a shared machine, and a test that fails must fail again.
settings.register_profile('house', deadline=None, derandomize=True)
settings.load_profile('house')

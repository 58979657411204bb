"""Settings of all tests."""

import os

# Before NumPy is loaded, and for all processes that tests start: threads of BLAS in several
# processes on few cores wait for each other, ten times as long as the work takes.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

from hypothesis import settings

from mechanism_sim.numerics import code_cache

# Wall time says nothing on a shared machine, and a test that fails must fail again.
settings.register_profile('house', deadline=None, derandomize=True)
settings.load_profile('house')

# Tests compile more than a user's cache holds, and open theirs once in a worker: heyoka's folder
# with its usual limit. To compile all anew would be most of the work of many tests.
code_cache.FOLDER, code_cache.LIMIT = 'heyoka', 20 * 2**30

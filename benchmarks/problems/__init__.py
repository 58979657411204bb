"""The problems of the benchmark, one module each: what `benchmarks.problem` finds."""

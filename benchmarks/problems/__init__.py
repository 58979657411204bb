"""The problems of the benchmark, one module each: what `mechanism_sim.bench.problem` finds."""

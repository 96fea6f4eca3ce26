"""One round of everything where the inputs are small."""

import pytest
from small import FOLDER


@pytest.fixture
def benchmark(benchmark):
    if FOLDER:
        pedantic = benchmark.pedantic
        benchmark.pedantic = lambda *args, **options: pedantic(*args, **options | {"rounds": 1})
    return benchmark

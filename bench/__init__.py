"""Benchmarks: `make bench`, or `make bench ONLY=name` for one. Every file bench_NAME.py here is a benchmark."""

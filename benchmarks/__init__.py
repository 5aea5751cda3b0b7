"""Benchmarks: every module here has ``measure()``, which yields lines of text; ``make bench`` prints them all.

Figures are ratios within one run, because machines differ and are noisy.
"""

"""Renders at quick size, and the two colors that the tests go between."""

from dataclasses import replace

from dyehouse.benchmarks import laboratory, speed_accuracy

FAST = replace(laboratory.FAST, threads=2)
COLORS = {name: speed_accuracy.COLORS[name] for name in ("blue", "red")}

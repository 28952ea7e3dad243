"""Nodes as users write them, some of them wrong."""

from __future__ import annotations

import math

import athermal


@athermal.feature
def twice(values, factor=2.0):
    """Each value times a factor."""
    return [None if value is None else factor * value for value in values]


@athermal.feature(own=True)
class Difference:
    """The difference of each channel to its value before."""

    def __init__(self, channels, factor=1.0):
        self.channels = channels
        self.factor = factor
        self.last = [None] * len(channels)

    def outputs(self):
        # A difference of temperatures is no temperature.
        return [athermal.Channel(of.name, "K" if of.unit == "Cel" else of.unit) for of in self.channels]

    def step(self, now, values):
        given = []
        for nth, value in enumerate(values):
            before, self.last[nth] = self.last[nth], self.last[nth] if value is None else value
            given.append(None if value is None or before is None else self.factor * (value - before))
        return given


@athermal.estimator
class Nearest:
    """A straight line through the first of the features."""

    def __init__(self, regressors, floor=0.0):
        self.floor = floor
        self.slope = self.mean = self.at = 0.0

    def fit(self, rows, truths):
        if len(rows) < 3:
            raise ValueError("three rows are needed")
        self.at = math.fsum(row[0] for row in rows) / len(rows)
        self.mean = math.fsum(truths) / len(rows)
        above = math.fsum((row[0] - self.at) * (truth - self.mean) for row, truth in zip(rows, truths))
        spread = math.fsum((row[0] - self.at) ** 2 for row in rows)
        self.slope = above / spread if spread else 0.0

    def predict(self, row):
        return self.mean + self.slope * (row[0] - self.at)


@athermal.feature
def zero_for_nothing(values):
    """Takes what is absent for zero."""
    return [0.0 if value is None else value for value in values]


COUNT = [0]


@athermal.feature
class Shared:
    """Counts in a place that all share."""

    def __init__(self, channels):
        pass

    def step(self, now, values):
        COUNT[0] += 1
        return [float(COUNT[0])] * len(values)


@athermal.feature
class Forgetful:
    """Its state is not all that it knows."""

    def __init__(self, channels):
        self.seen = 0

    def snapshot(self):
        return {}

    def restore(self, state):
        pass

    def step(self, now, values):
        self.seen += 1
        return [None if value is None else value * self.seen for value in values]


@athermal.feature
class Failing:
    """Fails after a while."""

    def __init__(self, channels):
        self.steps = 0

    def step(self, now, values):
        self.steps += 1
        if self.steps > 20:
            raise ZeroDivisionError("as a slip would")
        return values


@athermal.feature
def undocumented(values):
    return values

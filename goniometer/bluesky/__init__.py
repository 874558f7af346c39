"""The bench as devices for Bluesky's RunEngine.

>>> import goniometer.bluesky
>>> with goniometer.bluesky.devices("bench.yaml") as bench:                         # doctest: +SKIP
...     RE(grid_scan([bench.detector], bench.detector_arm, 0, 60, 61, bench.analyzer, 2, 6, 5, snake_axes=True))
"""

from goniometer.bluesky.bench import BlueskyBench as BlueskyBench
from goniometer.bluesky.bench import devices as devices

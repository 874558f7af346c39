"""What every test runs under."""

import gc
import os

import pytest
from hypothesis import settings

from acquisition import journal

settings.register_profile("untimed", deadline=None)  # how long an example takes says how busy the computer is
settings.load_profile("untimed")


def pytest_configure():
    """Let the processes that share the cores do linear algebra in one thread each; several wait for one another."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_collection_finish():
    """Let no search for garbage go through the thousands of tests themselves, which stay to the end."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def safe():
    """Let journals not wait for the disk, which is for power cuts alone; gives how they do otherwise."""
    safe = journal._SAFE
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(journal, "_SAFE", "PRAGMA synchronous=OFF")
        yield safe

"""What every test runs under."""

import gc

import pytest

from acquisition import journal


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

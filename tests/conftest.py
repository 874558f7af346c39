"""What every test runs under."""

import gc


def pytest_collection_finish():
    """Let no search for garbage go through the thousands of tests themselves, which stay to the end."""
    gc.collect()
    gc.freeze()

"""Machine code is made once, before the workers start, and not by each of them."""

from ctrl_df.warm import is_warm, warm_up


def pytest_sessionstart(session):
    """Compile ahead where nothing is kept of the engine as it stands."""
    if not hasattr(session.config, "workerinput") and not is_warm():
        warm_up()

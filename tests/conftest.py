"""Machine code is made once, before the workers start, and not by each of them."""

from ctrl_df.simulate import driver
from ctrl_df.warm import warm_up


def pytest_sessionstart(session):
    """Compile ahead where nothing is kept of the engine as it stands."""
    kept = getattr(driver.advance, "_cache", None)  # none where numba is switched off
    if not hasattr(session.config, "workerinput") and kept is not None and not kept.known:
        warm_up()

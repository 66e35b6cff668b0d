"""Why a run returned."""

DONE, EVENT, SECTION, FULL, STEPS, NAN, CHATTER, TINY, HISTORY = range(9)
"""End of time, stopped at an event, at the section, event log full, step bound, NaN, sliding, step below the
resolution of time, more steps within a delay than its history holds."""

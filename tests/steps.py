"""Steps from sample to sample beside the general ones: the same record, run both ways."""

import numpy as np

import ctrl_df as cdf


def record(rng, times, scale):
    """Two sines."""
    low, high = rng.uniform(2, 6), rng.uniform(9, 30)
    return scale * (np.sin(low * times) + 0.6 * np.sin(high * times + 1))


def compared(system, t, u, hold, short, propagated, instants):
    """Run a record both ways, the events alike; return the largest relative error of the outputs.

    `short` [s] is a longest step that leaves none from sample to sample; more than `propagated` of these are
    asked, and events within `instants` of the span.
    """
    fast = cdf.event_response(system, t, u, input_hold=hold)
    slow = cdf.event_response(system, t, u, input_hold=hold, max_step=short)
    assert fast.propagated > propagated and slow.propagated == 0
    assert [(e.subsystem, e.kind) for e in fast.events] == [(e.subsystem, e.kind) for e in slow.events]
    np.testing.assert_allclose(
        [e.time for e in fast.events], [e.time for e in slow.events], rtol=0, atol=instants * t[-1]
    )
    size = np.max(np.abs(slow.outputs), axis=-1, keepdims=True)
    return np.max(np.abs(fast.outputs - slow.outputs) / size)

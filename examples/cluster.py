r"""
A family on a cluster
=====================

**Problem.** A family N(a, ω) with many points, and more than one computer. How is the work spread, and are
the numbers the same?

.. code-block:: text

    this process ---[ dask scheduler ]---+---> worker 1: amplitudes 1, 2, ...
                                         +---> worker 2: amplitudes 7, 8, ...

**Method.** ``executor=`` takes anything with ``submit(f, *args).result()``: a thread pool, a process pool,
or the client of `dask.distributed <https://distributed.dask.org>`_. Here two worker processes on this
machine stand for the cluster; elsewhere give ``Client("tcp://scheduler:8786")`` its address. Compile ahead
on each node: ``ctrl-df warm-up``.

Needs ``pip install distributed``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf


def main():
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        print("0 workers: dask's distributed is not installed")
        return None

    block = cdf.Mass(9.0).with_effect(cdf.Stribeck(8.0, velocity=0.02)).with_effect(cdf.Coulomb(5.0))
    block = block.with_effect(cdf.Viscous(0.5))
    A, omega = np.geomspace(9, 40, 12), np.geomspace(4, 20, 16)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        spread = cdf.describing_function_family(block, A, omega, executor=client.get_executor())
        print(f"{len(client.scheduler_info()['workers'])} workers: {spread}")

    # **Check.** Here, in one process: bitwise the same.
    alone = cdf.describing_function_family(block, A, omega)
    assert np.array_equal(spread.harmonics, alone.harmonics, equal_nan=True)
    print("the same numbers as in one process: 0 differences")
    return spread


# %%
# **Result.** Worker processes import the script, so that the work stands below ``if __name__ ==
# "__main__"``, as in any script that starts processes.

if __name__ == "__main__":
    family = main()
    if family is not None:
        family.plot()
    sys.stdout.flush()
    plt.show()

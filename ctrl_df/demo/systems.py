"""The systems of the paper under their controllers, with what the paper claims of each."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from ..blocks.mechanism import Mechanism, backlash_masses, friction_mass
from ..blocks.pid import pid

FRICTION_BOX = np.geomspace(5.2, 100, 40), np.geomspace(4, 40, 60)
BACKLASH_BOX = np.geomspace(3, 60, 40), np.geomspace(8, 200, 60)


@dataclass(frozen=True)
class PaperLoop:
    """One loop of the paper.

    Attributes
    ----------
    key, title : str
        Short name and heading.
    plant : Mechanism
    controller : ct.TransferFunction
    box : pair of ndarray
        Amplitudes [N] and frequencies [rad/s] searched.
    claim : str
        What the paper says of it.
    starts : tuple of float
        Displaced rest starts of the simulations [m].
    time : float
        Their length [s].
    lesson : str
        What to make of the difference, once the exact answer is known.
    dt : float
        Sample time of the controller [s]; 0: continuous.
    search : bool
        Whether orbits missed by the prediction are searched for. Off where the irregular motion lasts for
        minutes and the search with it.
    """

    key: str
    title: str
    plant: Mechanism
    controller: ct.TransferFunction
    box: tuple[np.ndarray, np.ndarray]
    claim: str
    starts: tuple[float, ...]
    time: float
    lesson: str
    dt: float = 0.0
    search: bool = True


def friction_plant(static: float | None = None) -> Mechanism:
    """Return the mass of the paper's Fig. 2: M 9 kg, K 5 N, B 0.5 N s/m."""
    return friction_mass(mass=9, coulomb=5, viscous=0.5, static=static)


def backlash_plant(restitution: float) -> Mechanism:
    """Return the two masses of the paper's Fig. 6: load 8 kg, motor 1 kg, gap 18 mm."""
    return backlash_masses(motor_mass=1, load_mass=8, gap=0.018, restitution=restitution)


def friction_pid() -> ct.TransferFunction:
    """Return the PID of the paper's Fig. 5."""
    return pid(2000, 44250, 130)


def backlash_pid() -> ct.TransferFunction:
    """Return the PID of the paper's Figs. 9 and 10."""
    return pid(1800, 19500, 100)


def paper_loops() -> list[PaperLoop]:
    """Return every loop of the paper, with stiction at the levels that tell its story."""
    loops = [
        PaperLoop(
            "friction", "Coulomb + viscous friction (Fig. 5)", friction_plant(), friction_pid(), FRICTION_BOX,
            "a limit cycle; omega predicted well, amplitude less so",
            (0.0040, 0.0043), 12.0,
            "Does not hold: the only orbit is unstable, a boundary between decay and growth, and the second "
            "crossing has no orbit at all. Fig. 5 can only show the slow drift beside that boundary. The "
            "frequency of the boundary is right to 0.8 %.",
        )
    ]  # fmt: skip
    for static in (5.25, 5.5, 5.75):
        loops.append(
            PaperLoop(
                f"static {static:g}",
                f"the same with static level {static:g} N",
                friction_plant(static),
                friction_pid(),
                FRICTION_BOX,
                "with stiction almost the same",
                (0.0015,),
                600.0,
                "Does not hold: a few per cent of static friction make the loop hunt, stably, at a frequency "
                "of its own. The describing function hardly notices the static level.",
            )  # fmt: skip
        )
    loops.append(
        PaperLoop(
            "static 7.5",
            "the same with static level 7.5 N",
            friction_plant(7.5),
            friction_pid(),
            FRICTION_BOX,
            "with stiction almost the same",
            (0.003,),
            20.0,
            "Does not hold: above 5.9016 N there is no hunting cycle left; every breakaway throws the mass "
            "beyond the boundary and the loop diverges.",
        )  # fmt: skip
    )
    loops.append(
        PaperLoop(
            "backlash 0.2",
            "backlash, restitution 0.2 (Fig. 9)",
            backlash_plant(0.2),
            backlash_pid(),
            BACKLASH_BOX,
            "a limit cycle; omega predicted well, amplitude less so",
            (0.02,),
            60.0,
            "Holds, in the paper's own words: omega is off by 0.75 %, the amplitude by 13 %.",
        )  # fmt: skip
    )
    loops.append(
        PaperLoop(
            "backlash 0.8",
            "backlash, restitution 0.8 (Fig. 10)",
            backlash_plant(0.8),
            backlash_pid(),
            BACKLASH_BOX,
            "a limit cycle, almost chaotic; larger errors, above all in amplitude",
            (0.02,),
            500.0,
            "Holds in part: the irregular 14 rad/s motion of Fig. 10 is real but dies out. What remains is a "
            "rattle within the gap eleven times as fast, which the crossing near 126 rad/s announces and "
            "misplaces by 19 %. The two crossings near 15 rad/s lead to no orbit: the block does not keep "
            "their motions, one unstable and one of three periods beside another stable motion.",
            search=False,
        )  # fmt: skip
    )
    loops.append(
        PaperLoop(
            "sampled 0.8",
            "the same, PID sampled at 2 ms",
            backlash_plant(0.8),
            backlash_pid(),
            BACKLASH_BOX,
            "(not in the paper, which says nothing of the sampling of its simulations)",
            (0.02,),
            200.0,
            "A 2 ms zero-order hold keeps the irregular motion going: the sample time decides what one sees.",
            dt=0.002,
            search=False,
        )  # fmt: skip
    )
    return loops

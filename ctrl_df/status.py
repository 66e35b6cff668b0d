"""How a computation ended: every member's value is the message and the remedy."""

from enum import Enum


class Status(Enum):
    """Why a solver stopped; ``status.ok`` tells success, ``str(status)`` the message with its remedy.

    Examples
    --------
    >>> orbit = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(2000, 0, 130), cdf.friction_mass(9, 5)))
    >>> orbit.status.ok
    False
    """

    CONVERGED = "converged"
    NO_SOLUTION = "the whole box was scanned and holds no solution"
    WORK_LIMIT = (
        "stopped at the bound on work (steps or events); "
        "raise max_steps, loosen rtol, or shorten the time span"
    )
    DIVERGED = (
        "the state left every bound (overflow or NaN): the loop is unstable from here; "
        "lower the gains or start nearer to rest"
    )
    CHATTERING = (
        "infinitely many events in finite time (chatter, a sliding mode); "
        "give a relay a hysteresis or the loop a lag, a contact some compliance"
    )
    STEP_TOO_SMALL = (
        "the step fell below the resolution of time: the law is not continuous between its stated corners; "
        "state its corners, or loosen rtol"
    )
    HISTORY_FULL = (
        "a pure delay holds more steps than its history has room for; lengthen max_step or the sample time, "
        "shorten the delay, or put a lag of the same time in its place"
    )
    USER_ERROR = "a user-written law or system raised or returned NaN; see the exception it carries"
    NOT_CONVERGED = (
        "no periodic orbit was reached within the iterations allowed; start nearer or raise max_iterations"
    )
    NOT_FOUND = (
        "no periodic orbit was found from the starts tried, which is no proof that there is none; "
        "give a guess (amplitude, omega), a state near the orbit, or a longer search_time"
    )
    NO_SUCH_ORBIT = (
        "the prediction belongs to no orbit: on the way to one it merges with another motion, or with rest"
    )
    CENTRE = (
        "motions of every size repeat (a centre): none of them is a limit cycle; "
        "add damping, or a nonlinearity that depends on the amplitude"
    )
    NO_PERIOD = (
        "the motion from this start settles to no period; averages over many periods are given instead"
    )

    @property
    def ok(self) -> bool:
        """Whether the computation reached what was asked."""
        return self in (Status.CONVERGED, Status.NO_SOLUTION)

    def __str__(self) -> str:
        return self.value

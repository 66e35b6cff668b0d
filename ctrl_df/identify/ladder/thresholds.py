"""Numbers of the ladder that were chosen, each with its reason or what half and twice of it change."""

RIVALS = 2
"""Candidates that are fitted in the place of an effect of a ladder: beside a later one, and at its end.
Half and twice end a rig with two effects alike, twice in 1.1 of the time."""

BRANCHES = 3
"""Rivals of steps from which a ladder begins again, and ends no better, where it ended with something
unexplained: of two effects hidden one that stands in for both ranks first, and the right ones follow
(rigs)."""

PAIR_PROMISES = 4.0
"""Share of the residual's power that two effects should leave by the linear estimate, over the share that the
best one alone leaves as fitted, up to which they are fitted: fits halve the error that the estimate promises
(pair 76 of the second generator: 0.152 of the power, and 0.083 as fitted). Only work depends on it while the
right pair is among them."""

PAIR_STEPS, PAIRS_FITTED = 3, 6
"""Steps after which pairs of effects are compared for the first time, and pairs that are then fitted further:
they start where the linear estimate has them, so that the first steps tell which come near (rigs as above:
after eight steps the right pair is fourth at most)."""

LOOKED_BEYOND, PROMISED_BEYOND = 4, 0.5
"""Models of one effect or several beside which another one is sought, and whose effects are begun anew beside
each other; further ones that are fitted then; share of the residual's power that one beside a pair should
leave at most: of what slow noise makes an effect explains less (triple 12 of the second generator: a ripple
7 %, 44 nats). Of triple 8 Coulomb friction and a cubic spring are fourth of the pairs by evidence, behind a
joint and Stribeck friction, and first by what the third effect, a lag, leaves: 0.04 of the power; beside the
joint the best one leaves 0.67."""

STEPS_NEIGHBOUR, STEPS_SAME, STEPS_COMPARED = 8, 4, 6
"""Steps of a fit: of a model that differs by one effect, as many as the baseline takes (`BASE_STEPS`); of one
fitted before, over other data; of two models that are compared, as many as an effect is tried with
(`EFFORT_TRIED`). Half and twice of each end a rig with two effects alike, in the same time."""

"""Numbers of the ladder that were chosen, each with its reason or what half and twice of it change."""

RIVALS = 2
"""Candidates that are fitted in the place of an effect, beside a later one and at the end of a ladder. The
likeliest come first, and each costs a fit. Half and twice end a rig with two effects alike, twice in 1.1 of
the time."""

BRANCHES = 3
"""Rivals of steps from which a ladder that ended with something unexplained begins again, as long as it ends
no better. Of two effects hidden, one that stands in for both ranks first, and the right ones follow
(rigs)."""

PAIR_PROMISES = 4.0
"""Two effects are fitted if they should leave less of the residual's power, by the linear estimate, than so
many times what the best one alone leaves as fitted. Fits halve the error, and so quarter the power, that the
estimate promises; only work depends on the factor while the right pair is among those fitted. Pair 76 of the
second generator: 0.152 of the power by the estimate, 0.083 as fitted."""

PAIR_STEPS = 3
"""Steps of the fits of pairs of effects before these are compared for the first time. They start where the
linear estimate has them, so that the first steps tell which come near."""

PAIRS_FITTED = 6
"""Pairs that are fitted further after this comparison. The right pair has to be among them: after eight steps
it is fourth at most (pair 76 of the second generator)."""

LOOKED_BEYOND = 4
"""Models, the best ones, of one effect or several, beside which a further effect is sought, and of which each
effect is fitted again from new starts beside the others. The right pair need not be the first by evidence: of
triple 8 of the second generator Coulomb friction and a cubic spring are fourth, behind a joint and Stribeck
friction."""

FITTED_BEYOND = 4
"""Models with one effect more that are fitted, those that should leave least by the linear estimate. That
estimate finds what evidence of pairs does not: beside Coulomb friction and a cubic spring (triple 8) a lag
should leave 0.04 of the power, first of all, beside the joint the best one 0.67."""

PROMISED_BEYOND = 0.5
"""Share of the residual's power that a third effect should leave at most, by the linear estimate, to be
fitted. What slow noise makes is explained by an effect to a smaller part: by a ripple to 7 %, 44 nats (triple
12)."""

STEPS_NEIGHBOUR = 8
"""Steps of a fit of a model that differs by one effect, as many as the baseline takes (`BASE_STEPS`). Half
and twice end a rig with two effects alike, in the same time."""

STEPS_SAME = 4
"""Steps of a fit of a model that was fitted before, over other data: half as many, as it begins near its
minimum. Half and twice end a rig with two effects alike, in the same time."""

STEPS_COMPARED = 6
"""Steps of a fit of each of two models that are compared, as many as an effect is tried with
(`EFFORT_TRIED`). Half and twice end a rig with two effects alike, in the same time."""

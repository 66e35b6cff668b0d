"""The tables of what was judged on the rigs of the second generator."""

from __future__ import annotations

import numpy as np
from scipy.stats import binomtest

EDGE = 5.5  # times the noise: what is hidden shows little below, clearly above
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 0.999, 1.0)
DRAWN = (0.0, 0.5, 0.8, 0.95, 1.0)  # points that stand apart


def share(right, of):
    """Return a share with its 95 % interval."""
    if not of:
        return "–"
    low, high = binomtest(right, of).proportion_ci(method="wilson")
    return f"{right}/{of} = {right / of:.0%} ({low:.0%} to {high:.0%})"


def answered(row):
    """Return whether there is an answer; a stopped or failed rig has none, and counts as a miss."""
    return "verdict" in row


def shown(row):
    """Return how much of what is hidden shows, in times the noise; nan where nothing is known of the rig."""
    return row.get("facts", {}).get("shows", [float("nan")])[0]


def table(rows):
    """Return the results as markdown."""
    of = {
        k: [r for r in rows if r["job"][0] == k] for k in ("single", "nothing", "outside", "double", "triple")
    }
    lines = ["| measured | demanded | found |", "|---|---|---|"]

    def line(name, demanded, part, key):
        if part:
            lines.append(f"| {name} | {demanded} | {share(sum(map(bool, map(key, part))), len(part))} |")

    singles = of["single"]
    small = [r for r in singles if 0 < shown(r) < EDGE]
    large = [r for r in singles if shown(r) >= EDGE or not answered(r)]
    line("one hidden, all: first", "95 %", singles, lambda r: r.get("first"))
    line("the same, by one name and no other", "", singles, lambda r: r.get("strict"))
    line("one hidden, over 5 times the noise: first", "95 %", large, lambda r: r.get("first"))
    line(
        "the same: among the first three, or in the ambiguous class", "99 %", large, lambda r: r.get("three")
    )
    for closed, where in ((False, "in open loop"), (True, "under a PID")):
        part = [r for r in large if r.get("facts", {}).get("closed") is closed]
        line(f"the same {where}: first", "", part, lambda r: r.get("first"))
    line("1.5 to 5 times the noise: right, or honestly ambiguous or none", "95 %", small, honest)
    line("the same: wrong with p > 0.9", "≤ 1 %", small,
         lambda r: r.get("verdict") == "effect" and not r["first"] and r["said"] > 0.9)  # fmt: skip
    asked = [r["experiment"] for r in singles if "experiment" in r]
    line("ambiguous, the experiment asked for played: then `effect`, and right", "", asked,
         lambda e: e.get("verdict") == "effect" and e["right"])  # fmt: skip
    line("nothing hidden: none", "99 %", of["nothing"], lambda r: r.get("verdict") == "none")
    line("outside the library: unknown", "90 %", of["outside"], lambda r: r.get("verdict") == "unknown")
    line("outside the library: region right", "85 %", of["outside"], lambda r: r.get("region"))
    line("two hidden: both in the final model", "90 %", of["double"], lambda r: r.get("all"))
    line("three hidden: all in the final model", "75 %", of["triple"], lambda r: r.get("all"))
    claims = claims_of(rows)
    line(
        "said at 95 % or more: right",
        "95 %",
        [r for r in claims if r["said"] >= 0.95],
        lambda r: r.get("first"),
    )
    for key, name in (
        ("over_refit_free", "refitted, free run"),
        ("over_refit_auto", "refitted, free run where it holds still, else windows"),
        ("over_free", "or the truth's own if less, free run"),
        ("over_auto", "or the truth's own if less, free run where it holds still, else windows"),
    ):
        over = [r.get(key, np.inf) for r in singles if r.get("verdict") != "none"]
        if over:
            over = np.nan_to_num(np.array(over, float), nan=np.inf)
            middle, high = np.quantile(over, (0.5, 0.9), method="inverted_cdf")
            lines.append(
                f"| held-out error over the true structure's, {name}: median; 90th percentile "
                f"| 1.02; 1.2 | {middle:.3f}; {high:.3g} |"
            )
    values = [v for r in singles for v in r.get("values", ())]
    off = [v for r in rows for v in r.get("off", ())]
    line("two standard errors hold the truth: the effects found", "93–97 %", values, lambda v: v < 2)
    line("the same: all parameters of the true structure refitted", "93–97 %", off, lambda v: v < 2)
    for kind in of:
        seconds = [r["seconds"] for r in of[kind] if "seconds" in r]
        if seconds:
            stopped = sum("stopped" in r for r in of[kind])
            lines.append(
                f"| seconds, {kind}: median; 90th percentile; most | | {np.median(seconds):.0f}; "
                f"{np.quantile(seconds, 0.9):.0f}; {max(seconds):.0f}, {stopped} stopped |"
            )
    for name in dict.fromkeys(k for r in rows for k in r.get("peers", {})):
        for kind, what in (("single", "one hidden: named"), ("nothing", "nothing hidden: nothing named")):
            line(
                f"{name}, {what}", "", [r for r in of[kind] if "peers" in r], lambda r, n=name: r["peers"][n]
            )
    return "\n".join([*lines, "", *reliability(claims), "", *misses(rows)])


def honest(row):
    """Return whether an answer about a small effect is right or owns up."""
    return row.get("first") or row.get("verdict") in ("ambiguous", "none")


def claims_of(rows):
    """Return the rows of one diagnosis that names an effect, with a probability."""
    said = ("effect", "ambiguous")
    return [r for r in rows if r["job"][0] in ("single", "nothing", "outside") and r.get("verdict") in said]


def binned(claims, bins=BINS):
    """Yield least and largest probability said, how often, how often it was right, and the mean said."""
    for low, high in zip(bins, bins[1:], strict=False):
        part = [r for r in claims if low <= r["said"] < high or (high == 1.0 and r["said"] >= high)]
        if part:
            right = sum(bool(r.get("first")) for r in part)
            yield low, high, len(part), right, np.mean([min(r["said"], 1.0) for r in part])


def reliability(claims):
    """Return how often what was said with a probability was right."""
    lines = ["| probability said | times | right | mean said |", "|---|---|---|---|"]
    for low, high, times, right, mean in binned(claims):
        lines.append(f"| {low:g} to {high:g} | {times} | {share(right, times)} | {mean:.4f} |")
    return lines


def draw_reliability(claims, path):
    """Draw the share that was right over the probability said, with 95 % intervals."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, ax = plt.subplots(figsize=(3.6, 3.3), layout="constrained")
    ax.plot([0, 1], [0, 1], color="#8a94a0", lw=0.8)
    for _, _, times, right, mean in binned(claims, DRAWN):
        low, high = binomtest(right, times).proportion_ci(method="wilson")
        ax.plot([mean, mean], [low, high], color="#c8501e", lw=1.2)
        ax.plot(mean, right / times, "o", ms=4, color="#c8501e")
        ax.annotate(
            f"{right} of {times}", (mean, right / times), (-6, 2), textcoords="offset points", ha="right",
            va="bottom", fontsize=8,
        )  # fmt: skip
    ax.set(
        xlim=(0, 1.03),
        ylim=(-0.03, 1.03),
        xlabel="probability said",
        ylabel="share that was right",
        aspect="equal",
    )
    ax.spines[["top", "right"]].set_visible(False)
    fig.savefig(path, dpi=160)


def misses(rows):
    """Return every miss in a line."""
    lines = ["| rig | hidden | verdict | said | cause |", "|---|---|---|---|---|"]
    for r in rows:
        kind, number = r["job"]
        wrong = {
            "single": not r.get("first"), "nothing": r.get("verdict") != "none",
            "outside": r.get("verdict") != "unknown" or not r.get("region"),
        }.get(kind, not r.get("all"))  # fmt: skip
        if not wrong:
            continue
        said = ", ".join(
            f"{c['id']} {c['p']:.3f}" for c in r.get("ranking", ())[:3]
        ) or ", ".join(r.get("named", ()))  # fmt: skip
        facts = r.get("facts", {})
        where = f"{facts.get('base', '')} {'PID' if facts.get('closed') else 'open'} {facts.get('shows', '')}"
        cause = (
            r.get("cause")
            or r.get("error")
            or ("stopped" if "stopped" in r else ", ".join(r.get("regions", ())))
        )
        if "optimum" in r:
            cause += f" ({r['optimum']:.3g} of the true structure's error, place {r['place'] + 1})"
        hidden = ", ".join(r.get("hidden", ()))
        lines.append(f"| {kind} {number}: {where} | {hidden} | {r.get('verdict', '')} | {said} | {cause} |")
    return lines

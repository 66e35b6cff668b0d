"""Write the table of contents of the API: every public name, and the objects that they return."""

import ctrl_df as cdf

GROUPS = {
    "Machines and effects": "blocks",
    "Simulation": "simulate",
    "Describing functions": "df",
    "Limit cycles": "limit_cycles",
    "Controllers": "gains",
    "Records": "identify",
    "Pictures": "plot",
}
RESULTS = {
    "limit_cycles.check": ("Check", "Row"),
    "limit_cycles.exact.basins": ("Fate",),
    "simulate.response": ("EventResponse",),
    "identify.results.comparison": ("Comparison", "RecordComparison"),
    "identify.refit": ("Fit", "FittedParameter"),
    "identify.results.diagnosis": ("Diagnosis", "CandidateEffect"),
    "identify.results.ladder": ("Study", "Step"),
}


def room(name) -> str:
    """Return the room of the package in which a public name lives."""
    parts = getattr(getattr(cdf, name), "__module__", "").split(".")
    return parts[1] if len(parts) > 2 else ""


def write(folder):
    """Write api/index.md; autosummary makes a page of each entry."""
    folder.mkdir(exist_ok=True)
    names = sorted(set(cdf.__all__), key=str.lower)
    effects = {cls.__name__ for cls in cdf.effect_library().values()}
    text = "# API\n\n`import ctrl_df as cdf`. Effects have [pages of their own](../effects/index.md), too.\n"
    left = [n for n in names if room(n) not in GROUPS.values()]
    for title, key in [*GROUPS.items(), ("Other", None)]:
        chosen = left if key is None else [n for n in names if room(n) == key]
        first = [n for n in chosen if n not in effects]
        text += section(title, [f"ctrl_df.{n}" for n in first])
        if key == "blocks":
            text += section("Effects", [f"ctrl_df.{n}" for n in chosen if n in effects])
    made = [f"ctrl_df.{module}.{name}" for module, group in RESULTS.items() for name in group]
    text += section("Answers", made)
    for old in (folder / "generated").glob("*.rst"):  # of names that are gone
        if f"   {old.stem}\n" not in text:
            old.unlink()
    target = folder / "index.md"
    if not target.exists() or target.read_text() != text:
        target.write_text(text)


def section(title, entries) -> str:
    """Return one group of entries."""
    if not entries:
        return ""
    lines = "\n".join(f"   {e}" for e in entries)
    table = f".. autosummary::\n   :toctree: generated\n   :nosignatures:\n\n{lines}"
    return f"\n## {title}\n\n```{{eval-rst}}\n{table}\n```\n"

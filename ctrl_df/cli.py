"""The command ``ctrl-df``: the demo, limit cycles of a model file, a model improved with a record."""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .checks import place_to_write
from .model_file import EXAMPLE, ModelFile, read_model
from .versions import version

BAD_INPUT = 2
_SECTIONS = f"MODEL.toml, all sections:\n\n{EXAMPLE}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit code: 0, or 2 for unusable input (one line on stderr)."""
    options = _parser().parse_args(argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # whoever waits at a pipe sees lines as they come
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ValueError, TypeError, OSError, RuntimeError) as error:
        print(f"ctrl-df: error: {_sentence(error)}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("ctrl-df: interrupted", file=sys.stderr)
        return 130


def _sentence(error: Exception) -> str:
    """Return an error as one line; those of the system by the file and what is wrong with it."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}. Check the path."
    return " ".join(str(error).split())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ctrl-df",
        description="Limit cycles of drives with friction and backlash, and the effect a model is missing.",
        epilog=f"example:\n  ctrl-df demo --out pictures\n\n{_SECTIONS}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"ctrl-df {version()}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(name: str, text: str, example: str, sections: str = ""):
        return commands.add_parser(
            name,
            help=text,
            description=f"{text[0].upper()}{text[1:]}.",
            epilog=f"example:\n  {example}\n\n{sections}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    demo = command(
        "demo",
        "the paper's systems and a hidden-effect study: tables, pictures",
        "ctrl-df demo --out pictures",
    )
    demo.add_argument(
        "--out",
        default="ctrl-df-demo",
        metavar="DIR",
        help="directory for the pictures (default %(default)s)",
    )
    demo.set_defaults(run=_demo)

    cycles = command(
        "limit-cycles",
        "limit cycles of a model: predicted, exact, simulated",
        "ctrl-df limit-cycles axis.toml --json > axis.json",
        _SECTIONS,
    )
    cycles.add_argument("model", metavar="MODEL.toml")
    cycles.add_argument("--json", action="store_true", help="print JSON instead of text")
    cycles.set_defaults(run=_limit_cycles)

    warm = command("warm-up", "compile in advance what would be compiled on first use", "ctrl-df warm-up")
    warm.set_defaults(run=_warm_up)

    better = command(
        "improve",
        "find what a model is missing, from a record",
        "ctrl-df improve run3.csv --model axis.toml --report run3.html",
        _SECTIONS,
    )
    better.add_argument("data", metavar="DATA.csv")
    better.add_argument("--model", required=True, metavar="MODEL.toml")
    better.add_argument("--report", metavar="OUT.html", help="write one self-contained HTML page")
    better.add_argument("--json", action="store_true", help="print JSON instead of text")
    better.add_argument(
        "--budget", type=float, metavar="SECONDS", help="return the best model known after this many seconds"
    )
    better.add_argument(
        "--progress", action=argparse.BooleanOptionalAction, default=None,
        help="report progress on stderr (default: if that is a terminal)",
    )  # fmt: skip
    better.set_defaults(run=_improve)
    return parser


def _demo(options) -> int:
    from .demo import run
    from .warm import is_warm, warm_up

    if not is_warm():
        warm_up(progress=True)
    run(Path(options.out))
    return 0


def _warm_up(options) -> int:
    from .warm import warm_up

    warm_up(progress=True)
    return 0


# --- limit cycles -------------------------------------------------------------------------------------------


def _limit_cycles(options) -> int:
    from .limit_cycles.predicted.predict import describing_function_response
    from .limit_cycles.verify import verify
    from .simulate.loop import closed_loop

    model = read_model(options.model)
    if model.controller is None:
        raise ValueError(f"{model.path} needs a section [controller] (kp, ki, kd) to close the loop.")
    if model.amplitudes is None:
        raise ValueError(f"{model.path} needs a section [box] (amplitude, omega: each [low, high]).")
    response = describing_function_response(model.controller, model.plant, model.amplitudes, model.omega)
    check = verify(response, loop=closed_loop(model.controller, model.plant, dt=model.dt))  # type: ignore[arg-type]
    if options.json:
        _print_json(
            {
                "model": model.path,
                "plant": repr(model.plant),
                "status": response.status,
                "cycles": [_row(r) for r in check],
                "fate": [{"size": s.size, "fate": s.fate, "told": s.told} for s in check.fate],
                "note": check.note,
            }
        )
        return 0
    print(f"{model.plant!r}\n{response.status}\n\n{check.table()}")
    for cycle in response.limit_cycles:
        print(f"\n{cycle.amplitude:.5g} @ {cycle.omega:.5g} rad/s, {cycle.grade}: {cycle.why}")
    return 0


def _row(row) -> dict[str, Any]:
    out: dict[str, Any] = {"verdict": row.verdict, "predicted": None, "exact": None, "simulated": None}
    if row.predicted is not None:
        names = ("amplitude", "output_amplitude", "omega", "stable", "distortion", "omega_band")
        names += ("amplitude_band", "sensitivity", "grade", "why", "regime")
        out["predicted"] = {n: getattr(row.predicted, n) for n in names}
    if row.exact is not None:
        names = ("amplitude", "output_amplitude", "omega", "period", "stable", "residual", "multiplier")
        out["exact"] = {n: getattr(row.exact, n) for n in names} | {"status": row.exact.status.value}
    if row.why:
        out["why"] = row.why
    if row.simulated is not None:
        out["simulated"] = {"omega": row.simulated[0], "output_amplitude": row.simulated[1]}
    return out


# --- improve ------------------------------------------------------------------------------------------------


def _improve(options) -> int:
    from .identify.data.measurement import Measurement
    from .identify.improve import improve

    model = read_model(options.model)
    if options.report:
        place_to_write("improve", "--report", options.report)
    columns = {"time": "t", "input": "r" if model.closed_loop else "F", "output": "x", **model.columns}
    record = Measurement.from_csv(options.data, **columns)
    study = improve(_subject(model), record, budget=options.budget, progress=options.progress)
    if math.isnan(study.steps[0].nrmse):  # Ctrl-C before anything was known
        raise KeyboardInterrupt
    if options.report:
        study.report(options.report)
    if options.json:
        _print_json(_study(study))
    else:
        print(study.summary())
        if options.report:
            print(f"\nreport: {options.report}")
    return 0


def _subject(model: ModelFile):
    if not model.closed_loop:
        return model.plant
    from .simulate.loop import closed_loop

    return closed_loop(model.controller, model.plant, model.dt)  # type: ignore[arg-type]


def _study(study) -> dict[str, Any]:
    steps = []
    for step in study.steps:
        values = {n: getattr(step, n, None) for n in ("effect", "nrmse", "nrmse_holdout")}
        effect = values["effect"]
        values["effect"] = getattr(effect, "id", effect)
        values["parameters"] = _parameters(getattr(step, "parameters", {}))
        steps.append(values)
    block = getattr(getattr(study.model, "parts", None), "block", study.model)
    return {
        "verdict": study.verdict,
        "status": study.status,
        "steps": steps,
        "model": repr(block),
        "parameters": _parameters(getattr(block, "parameters", {})),
    }


def _parameters(table) -> dict[str, Any]:
    out = {}
    for name, p in dict(table).items():
        out[name] = {"value": float(getattr(p, "value", p)), "unit": getattr(p, "unit", "")}
        error = getattr(p, "standard_error", getattr(p, "error", None))
        if error is not None:
            out[name]["standard_error"] = error
    return out


def _print_json(answer) -> None:
    print(json.dumps(_plain(answer), indent=2, allow_nan=False))


def _plain(value):
    """Numbers of numpy and non-finite ones as JSON knows them (nan and inf become null)."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, str | bool | None):
        return value
    if isinstance(value, int):
        return value
    try:
        number = value.item() if hasattr(value, "item") else value
        if isinstance(number, bool | int | str):
            return number
        return float(number) if math.isfinite(number) else None
    except (TypeError, ValueError):
        return str(value)

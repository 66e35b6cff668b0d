"""The demo: the paper's systems and figures, and a hidden-effect study; the paper is Azenha & Machado (1997)."""

from .run import run

__all__ = ["run"]

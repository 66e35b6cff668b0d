"""The demo: systems and figures of Azenha & Machado (1997), and a hidden-effect study."""

from .run import run

__all__ = ["run"]

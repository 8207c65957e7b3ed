"""The engine as everybody calls it: what `base.py` loads and runs, and the studies of this folder's other modules."""

from functools import lru_cache

from playground.engine.base import BaseEngine


class Engine(BaseEngine):
    """Loads each system once and answers from any thread; holds no state of a call."""


@lru_cache(maxsize=1)
def default_engine() -> Engine:
    """The engine on the repository's own assets, one a process."""
    return Engine()

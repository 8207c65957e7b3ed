"""The one launcher of work that many processes share: Lightning Fabric, on one machine or under torchrun on several."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from playground.errors import PlaygroundError

if TYPE_CHECKING:
    from lightning.fabric import Fabric


@dataclass(frozen=True)
class Launch:
    """Where a run computes. Under torchrun, devices and nodes come from its environment."""

    accelerator: str = "auto"
    devices: int | str = "auto"
    nodes: int = 1
    strategy: str = "auto"
    precision: str = "auto"  # auto: bf16-mixed on CPU and GPU; 32-true turns mixed precision off


def launched() -> bool:
    """Whether this process is one of those that torchrun started."""
    return "LOCAL_WORLD_SIZE" in os.environ


def launch_fabric(launch: Launch, loggers: Sequence[Any] = ()) -> "Fabric":
    """A launched Fabric; the package lightning is imported here. PlaygroundError if the accelerator is not there."""
    from lightning.fabric import Fabric
    from lightning.fabric.utilities.exceptions import MisconfigurationException

    precision = "bf16-mixed" if launch.precision == "auto" else launch.precision
    devices, nodes = launch.devices, launch.nodes
    if launched():  # torchrun has decided already
        devices = int(os.environ["LOCAL_WORLD_SIZE"])
        nodes = int(os.environ["WORLD_SIZE"]) // devices
    elif devices == "auto":
        devices = 1
    try:
        fabric = Fabric(
            accelerator=launch.accelerator,
            devices=devices,
            num_nodes=nodes,
            strategy=launch.strategy,
            precision=precision,  # type: ignore[arg-type]
            loggers=list(loggers),
        )
    except (MisconfigurationException, RuntimeError) as error:
        raise PlaygroundError(
            f"this machine cannot compute on {devices} of the accelerator {launch.accelerator!r}; auto or cpu will do"
        ) from error
    fabric.launch()
    return fabric

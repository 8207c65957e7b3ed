"""The one launcher of work that many processes share: Lightning Fabric, on one machine or under torchrun on several."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
    """A launched Fabric; the package lightning is imported here."""
    from lightning.fabric import Fabric

    precision = "bf16-mixed" if launch.precision == "auto" else launch.precision
    devices, nodes = launch.devices, launch.nodes
    if launched():  # torchrun has decided already
        devices = int(os.environ["LOCAL_WORLD_SIZE"])
        nodes = int(os.environ["WORLD_SIZE"]) // devices
    elif devices == "auto":
        devices = 1
    fabric = Fabric(
        accelerator=launch.accelerator,
        devices=devices,
        num_nodes=nodes,
        strategy=launch.strategy,
        precision=precision,  # type: ignore[arg-type]
        loggers=list(loggers),
    )
    fabric.launch()
    return fabric

"""Arrays and tensors from the CPU to a device without waiting for what the device is doing."""

import torch
from numpy.typing import NDArray
from torch import Tensor


def on_device(values: "Tensor | NDArray", device: torch.device | str) -> Tensor:
    """The values as a tensor on `device`; to a GPU from page-locked memory, so that the copy waits in its queue."""
    tensor = values if isinstance(values, Tensor) else torch.from_numpy(values)
    if torch.device(device).type != "cuda" or tensor.device.type != "cpu":
        return tensor.to(device)
    return tensor.pin_memory().to(device, non_blocking=True)

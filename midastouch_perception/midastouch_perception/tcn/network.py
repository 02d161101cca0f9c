"""Architecture of the `fast` tactile code network: a small residual network on the penetration map."""

from __future__ import annotations

import itertools

import torch
from torch import nn


class _Block(nn.Module):
    def __init__(self, inputs: int, outputs: int, stride: int):
        super().__init__()
        self.first = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
        )
        self.second = nn.Sequential(nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False), nn.BatchNorm2d(outputs))
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(self.second(self.first(x)) + self.shortcut(x))


class CodeNet(nn.Module):
    """Network from maps to codes: forward(maps (B, 4, 80, 60)) -> codes (B, dim), L2-normalised.

    The maps come from `inference.code_input`. The last feature map (5 x 4) is flattened, not pooled, because the
    position of the contact on the gel is information.
    """

    def __init__(self, dim: int = 64, widths: tuple[int, ...] = (16, 32, 64, 128)):
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(4, widths[0], 5, 2, 2, bias=False), nn.BatchNorm2d(widths[0]), nn.ReLU(inplace=True)
        )
        pairs = itertools.pairwise(widths)
        self.blocks = nn.Sequential(*(_Block(a, b, 2) for a, b in pairs), _Block(widths[-1], 32, 1))
        self.head = nn.Linear(32 * 5 * 4, dim)
        # learned sharpness of the contrastive loss; not used at inference
        self.log_temperature = nn.Parameter(torch.tensor(-2.7))

    def forward(self, maps: torch.Tensor) -> torch.Tensor:
        return nn.functional.normalize(self.head(self.blocks(self.stem(maps)).flatten(1)), dim=1)

"""The `fast` tactile depth network: a small U-Net at half the image's resolution."""

from __future__ import annotations

import itertools

import torch
from torch import nn


def _conv(inputs: int, outputs: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class UNet(nn.Module):
    """Difference image and sensor geometry to penetration and contact.

    forward(difference (B, 3, 160, 120), geometry (B, 3, 160, 120)) -> (B, 2, 160, 120): penetration [mm], contact
    logit. Inputs as `inference.difference_input` and `inference.geometry_input` make them. The first layer halves the
    resolution, so the costly layers run at 80 x 60; sub-pixel convolution restores it.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 96, 128)):
        super().__init__()
        self.stem = nn.Sequential(_conv(6, widths[0], 2, 5), _conv(widths[0], widths[0]))
        pairs = list(itertools.pairwise(widths))
        self.down = nn.ModuleList(nn.Sequential(_conv(a, b, 2), _conv(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(nn.Sequential(_conv(a + b, a), _conv(a, a)) for a, b in reversed(pairs))
        self.head = nn.Sequential(nn.Conv2d(widths[0], 8, 3, 1, 1), nn.PixelShuffle(2))

    def forward(self, difference: torch.Tensor, geometry: torch.Tensor) -> torch.Tensor:
        return self.decode(self.encode(difference, geometry))

    def encode(self, difference: torch.Tensor, geometry: torch.Tensor) -> list[torch.Tensor]:
        """Feature maps, fine to coarse; the last is the bottleneck (B, 128, 5, 4)."""
        features = [self.stem(torch.cat([difference, geometry], 1))]
        for layer in self.down:
            features.append(layer(features[-1]))
        return features

    def decode(self, features: list[torch.Tensor]) -> torch.Tensor:
        """Output of `forward` from the feature maps, which it uses up."""
        out = features.pop()
        for layer in self.up:
            skip = features.pop()
            # by factors that are numbers when exported: ONNX Runtime then scales in the layout of its convolutions
            factors = tuple(float(skip.shape[k]) / float(out.shape[k]) for k in (-2, -1))
            out = nn.functional.interpolate(out, scale_factor=factors, mode="bilinear", align_corners=False)
            out = layer(torch.cat([out, skip], 1))
        return self.head(out)


class UNetWithEmbedding(nn.Module):
    """A trained `UNet` that also returns its bottleneck (B, 2560), L2-normalised: the paper's image embedding."""

    def __init__(self, unet: UNet):
        super().__init__()
        self.unet = unet

    def forward(self, difference: torch.Tensor, geometry: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        features = self.unet.encode(difference, geometry)
        embedding = nn.functional.normalize(features[-1].flatten(1), dim=1)
        return self.unet.decode(features), embedding

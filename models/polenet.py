"""PoleNet: a small bottom-up network that outlines light poles, and its weights file.

An encoder to 1/32 of the input with row and column context at its end (poles are long: the rows of a pole must know
of each other), a feature pyramid back to 1/4, and three heads:

    mask     (B, 1, H, W)      logit that the pixel shows a light pole, at the full input size
    centre   (B, 1, H/8, W/8)  logit that the centre of an instance lies in the cell
    offsets  (B, 2, H/4, W/4)  from the cell to the centre of its instance, in units of `OFFSET_SCALE_PX`

The centre head and the offsets are those of Panoptic-DeepLab (Cheng et al., CVPR 2020); the mask comes from a pixel
shuffle of the 1/2 level. H and W are multiples of 32 (`segmentation.STRIDE_PX`).
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import torch
import torch.nn.functional as F
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as as_safetensors
from torch import Tensor, nn

from scpf.models.errors import InputError, MissingError
from scpf.models.grouping import ScoreCalibration
from scpf.models.whole_files import write_whole

SHIPPED = "polenet"  # the name of the weights that come with scpf
FORMAT = "scpf-polenet"
FORMAT_VERSION = 3
READABLE_VERSIONS = ("2", "3")  # the former without a tile gate

CHANNELS = (16, 32, 48, 96, 128)  # after each halving of the resolution
BLOCKS = (0, 0, 2, 2, 2)  # residual blocks there: at 1/4 one would cost a tenth of the network
PYRAMID_CHANNELS = 32
PIXEL_MEAN, PIXEL_DEVIATION = 0.45, 0.25  # of RGB values 0 to 1


def _conv_norm_relu(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    """relu(second(relu(first(x))) + x) of two 3×3 convolutions, each with its batch norm."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _conv_norm_relu(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.second(self.first(x)).add_(x), inplace=True)


class _RowColumnContext(nn.Module):
    """Adds to every cell what its whole row and its whole column hold on average."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.mix = nn.Conv2d(2 * channels, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        column = x.mean(2, keepdim=True).expand_as(x)
        row = x.mean(3, keepdim=True).expand_as(x)
        return x + self.mix(torch.cat([column, row], 1))  # type: ignore[no-any-return]


class Levels(NamedTuple):
    """Of the encoder ``half`` (B, 16, H/2, W/2) and ``quarter`` (B, 32, H/4, W/4), of the pyramid ``eighth``."""

    half: Tensor
    quarter: Tensor
    eighth: Tensor


class PoleNet(nn.Module):
    """The network; input (B, 3, H, W) as `polenet_inference.to_input` makes it, outputs as the module says."""

    def __init__(self) -> None:
        super().__init__()
        stages: list[nn.Module] = []
        channels = 3
        for outputs, blocks in zip(CHANNELS, BLOCKS, strict=True):
            residuals = [Residual(outputs) for _ in range(blocks)]
            stages.append(nn.Sequential(_conv_norm_relu(channels, outputs, stride=2), *residuals))
            channels = outputs
        stages[-1] = nn.Sequential(stages[-1], _RowColumnContext(channels))
        self.stages = nn.ModuleList(stages)
        width = PYRAMID_CHANNELS
        self.lateral = nn.ModuleList([nn.Conv2d(c, width, 1) for c in CHANNELS[1:]])
        self.smooth = nn.ModuleList([_conv_norm_relu(width, width) for _ in CHANNELS[1:-1]])
        self.fine_low = nn.Conv2d(CHANNELS[0], 16, 1)
        self.fine_up = nn.Conv2d(width, 16, 1)
        self.fine = _conv_norm_relu(16, 16)
        self.mask = nn.Conv2d(16, 4, 1)  # 4 = 2 × 2 pixels of the full resolution
        self.centre = nn.Sequential(_conv_norm_relu(width, width), nn.Conv2d(width, 1, 1))
        self.offsets = nn.Conv2d(width, 2, 3, 1, 1)
        # Poles and centres are rare: starting from low odds keeps the first steps calm.
        nn.init.constant_(self.mask.bias, -2.0)  # type: ignore[arg-type]
        nn.init.constant_(self.centre[-1].bias, -4.0)  # type: ignore[arg-type]

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        levels = self.levels(x)
        mask, offsets = self.finest(levels)
        return F.pixel_shuffle(mask, 2), self.centre(levels.eighth), offsets

    def levels(self, x: Tensor) -> Levels:
        """What the outputs are made of: the encoder, and the pyramid down to 1/8."""
        features = []
        for stage in self.stages:
            x = stage(x)
            features.append(x)
        pyramid = self.lateral[3](features[4])
        for k in (2, 1):
            above = F.interpolate(pyramid, scale_factor=2.0)
            pyramid = self.smooth[k](self.lateral[k](features[k + 1]).add_(above))
        return Levels(features[0], features[1], pyramid)

    def finest(self, levels: Levels) -> tuple[Tensor, Tensor]:
        """The mask before its pixel shuffle (B, 4, H/2, W/2), four pixels a cell row by row, and the offsets."""
        above = F.interpolate(levels.eighth, scale_factor=2.0)
        pyramid = self.smooth[0](self.lateral[0](levels.quarter).add_(above))
        up = F.interpolate(self.fine_up(pyramid), scale_factor=2.0, mode="bilinear", align_corners=False)
        fine = self.fine(F.relu(up.add_(self.fine_low(levels.half)), inplace=True))
        return self.mask(fine), self.offsets(pyramid)


NOT_CALIBRATED = ScoreCalibration(1.0, 0.0, 0.0, 0.0)  # the score is the centre's peak
CONVENTIONS = (
    "a mask holds the pixels whose centres the object covers; boxes x1 y1 x2 y2 in px, the ends exclusive"
)


@dataclass(frozen=True)
class WeightsInfo:
    """What a weights file says about itself. ``conventions``: of what comes out; ``tile_gate``: of `pole_tiles`."""

    trained_on: str
    calibration: ScoreCalibration = NOT_CALIBRATED
    classes: tuple[str, ...] = ("light_pole",)
    input: str = f"RGB, uint8 / 255, minus {PIXEL_MEAN}, divided by {PIXEL_DEVIATION}; sides padded to 32 px"
    conventions: str = CONVENTIONS
    licence: str = "Apache-2.0"
    figures: dict[str, float] = field(default_factory=dict)
    tile_gate: tuple[float, ...] | None = None


def mixed(net: PoleNet, other: PoleNet, share: float) -> PoleNet:
    """``net`` with all its weights moved towards those of ``other`` by ``share``, in place.

    Of weights that were trained on from others, the mean generalises better than either (Wortsman et al., CVPR 2022,
    "Robust fine-tuning of zero-shot models").
    """
    with torch.no_grad():
        for own, theirs in zip(net.state_dict().values(), other.state_dict().values(), strict=True):
            if own.is_floating_point():
                own.lerp_(theirs, share)
    return net


def save(path: Path, net: PoleNet, info: WeightsInfo) -> None:
    """Writes the weights as half floats (2.6 MB) with their description."""
    tensors = {
        name: (value.half() if value.is_floating_point() else value).contiguous()
        for name, value in net.state_dict().items()
        if not name.endswith("num_batches_tracked")
    }
    metadata = {"format": FORMAT, "format_version": str(FORMAT_VERSION), "info": write_info(info)}
    write_whole(path, as_safetensors(tensors, metadata))  # its own files only their owner may read


def write_info(info: WeightsInfo) -> str:
    """The description as JSON."""
    return json.dumps({name: value for name, value in asdict(info).items() if value is not None})


def read_info(path: Path, text: str) -> WeightsInfo:
    """The description that `write_info` wrote into a file; raises InputError where it is damaged."""
    try:
        fields = json.loads(text)
        fields["calibration"] = ScoreCalibration(**fields["calibration"])
        fields["classes"] = tuple(fields["classes"])
        if "tile_gate" in fields:
            fields["tile_gate"] = _tile_gate(fields["tile_gate"])
        return WeightsInfo(**fields)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: the description of the weights is damaged ({error})") from error


def _tile_gate(weights: list[float]) -> tuple[float, ...]:
    gate = tuple(map(float, weights))
    if len(gate) != PYRAMID_CHANNELS + 1 or not all(map(math.isfinite, gate)):
        raise ValueError(f"a gate of {len(gate)} numbers, {PYRAMID_CHANNELS + 1} finite ones are needed")
    return gate


def weights_path(name: str | Path) -> Path:
    """The file of a name: ``polenet`` for the weights that come with scpf, else a path."""
    return Path(__file__).with_name(f"{SHIPPED}.safetensors") if str(name) == SHIPPED else Path(name)


def load(path: Path) -> tuple[PoleNet, WeightsInfo]:
    """The network (in evaluation mode, batch norm not folded) and the description of a weights file.

    Raises MissingError where there is no such file and InputError where it is damaged, not PoleNet's, or newer.
    """
    if not path.is_file():
        raise MissingError(f"{path}: no such weights file")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise InputError(
            f"{path}: not a whole safetensors file ({error})", "fetch or copy it again"
        ) from error
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path}: not PoleNet weights (no {FORMAT!r} in the metadata)")
    if (found := metadata.get("format_version")) not in READABLE_VERSIONS:
        readable = " and ".join(READABLE_VERSIONS)
        raise InputError(f"{path}: weights format {found}, this scpf reads {readable}", "update scpf")
    info = read_info(path, metadata.get("info", ""))
    net = PoleNet()
    counters = {
        name: value for name, value in net.state_dict().items() if name.endswith("num_batches_tracked")
    }
    try:
        net.load_state_dict({**tensors, **counters})
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: the tensors are not those of PoleNet ({reason})") from error
    if not all(bool(torch.isfinite(value).all()) for value in tensors.values()):
        raise InputError(f"{path}: the weights hold values that are not finite")
    return net.eval(), info

"""`midastouch train-tdn` and `train-tcn`: train the `fast` networks on simulated touches."""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra

from . import arguments, limits

if TYPE_CHECKING:
    from midastouch_simulation.training.setting import TrainingOptions


def add_parser(subparsers) -> None:
    """Add both sub-commands."""
    parser = _add_command(subparsers, "train-tdn", _train_tdn, "train the depth network on simulated touches")
    parser.add_argument(
        "--light",
        choices=("additive", "relative"),
        default="additive",
        help="of the sensors to train for: additive, TACTO's (default), or relative, real gel's",
    )
    parser = _add_command(subparsers, "train-tcn", _train_tcn, "train the code network on simulated touches")
    parser.add_argument(
        "--tdn", default="fast", metavar="NET", help="depth network the touches go through (default fast)"
    )


def _train_tdn(args: argparse.Namespace) -> int:
    options = dataclasses.replace(_options(args), light=args.light)
    from midastouch_simulation.training.tdn import train

    print(f"{train(options)}: trained")
    return 0


def _train_tcn(args: argparse.Namespace) -> int:
    options = _options(args)
    from midastouch_simulation.training.tcn import train

    print(f"{train(options, args.tdn)}: trained")
    return 0


def _add_command(subparsers, name: str, run: Callable, summary: str) -> argparse.ArgumentParser:
    """Add a training sub-command with the options that both have; return its parser."""
    parser = arguments.add_command(
        subparsers,
        name,
        run,
        summary,
        f"midastouch {name} --minutes 20 --out out/{name}",
        "Writes weights (ONNX), model card, checkpoint, log and curves to the folder --out. Needs PyTorch.",
    )
    parser.add_argument("--minutes", type=limits.minutes, default=30.0, help="time budget (default 30)")
    parser.add_argument(
        "--steps", type=limits.steps, help="end after this many steps instead: repeatable with its seed"
    )
    parser.add_argument("--resume", metavar="FILE", help="checkpoint of an earlier run, or its folder, to resume")
    parser.add_argument("--start", metavar="NET", help="begin with the weights of this network, name or file")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default cpu")
    parser.add_argument(
        "--meshes", default="../shared/meshes/ycb", metavar="DIR", help="objects to train on (default %(default)s)"
    )
    parser.add_argument(
        "--backgrounds",
        default="../shared/data/digit_backgrounds",
        metavar="DIR",
        help="real no-contact images (default %(default)s)",
    )
    parser.add_argument(
        "--colour-table", metavar="FILE", help="colours of a real DIGIT, polycalib.npz of the Taxim simulator"
    )
    arguments.add_place(parser, "--out", "folder", "folder for the results", f"out/{name}")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of weights and data (default 0)")
    return parser


def _options(args: argparse.Namespace) -> TrainingOptions:
    """Return the options of both commands. InputError without PyTorch, if the checkpoint to resume is
    missing, or if --out holds a run that is not resumed."""
    if importlib.util.find_spec("torch") is None:
        raise InputError(f"training needs PyTorch, which is not installed; run: {install_extra('train')}")
    # before PyTorch loads: its OpenMP threads would fight the renderer's and the rendering workers for the cores
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    resume = Path(args.resume) if args.resume else None
    if resume is not None and not resume.exists():
        raise InputError(f"{resume}: no such checkpoint; give a file or folder written by an earlier run")
    if resume is not None and resume.is_file():
        resume = resume.parent
    if resume is None and (args.out / "checkpoint.safetensors").exists():
        raise InputError(f"{args.out}: holds an earlier run; give --resume {args.out}, or another folder")
    from midastouch_simulation.training.setting import TrainingOptions

    print(f"loading PyTorch, {args.meshes} and {args.backgrounds}; results go to {args.out}", flush=True)
    return TrainingOptions(
        meshes=Path(args.meshes),
        backgrounds=Path(args.backgrounds),
        colour_table=Path(args.colour_table) if args.colour_table else None,
        out=args.out,
        minutes=args.minutes,
        steps=args.steps,
        seed=args.seed,
        workers=max(len(os.sched_getaffinity(0)) - 1, 1),
        device=args.device,
        resume=resume,
        start=args.start,
    )

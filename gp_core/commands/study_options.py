"""Options that the commands of the study share: features, JRMPC settings, figures."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from gp_core.landmarks.features import CODES, EXTERNAL, PROBE, TRAINING, check_codes
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcSettings

__all__ = ["add_features", "add_figure", "add_settings", "features_of", "save_figure_of", "settings_of"]

SETTINGS = {"estimation": ESTIMATION, "defaults": DEFAULTS}


def add_features(parser: argparse.ArgumentParser) -> None:
    """Add ``--training`` and ``--probe``."""
    parser.add_argument(
        "--training",
        nargs="+",
        metavar="CODE",
        help="features of the training animals, or all; default: the paper's 16",
    )
    parser.add_argument(
        "--probe",
        nargs="+",
        metavar="CODE",
        help="touched features, or all (external ones in training); default: the paper's six",
    )


def features_of(args: argparse.Namespace) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the training and the probe features that were asked for."""
    training = _codes(args.training, "--training", TRAINING, CODES)
    return training, _codes(args.probe, "--probe", PROBE, tuple(c for c in EXTERNAL if c in training))


def _codes(
    words: list[str] | None, option: str, default: tuple[str, ...], everything: tuple[str, ...]
) -> tuple[str, ...]:
    if words is None:
        return default
    codes = [code for word in words for code in word.split(",") if code]
    return everything if [code.lower() for code in codes] == ["all"] else check_codes(codes, option)


def add_settings(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the settings of JRMPC: one of two by name, and its three numbers."""
    group = parser.add_argument_group("settings of JRMPC")
    group.add_argument(
        "--settings",
        choices=tuple(SETTINGS),
        help="estimation: 60 iterations, gamma 0.05, epsilon 1e-9; defaults: 100 iterations, gamma 1/K, "
        f"epsilon 1e-6; default: {default}",
    )
    group.add_argument("--max-iterations", type=int, metavar="N", help="instead of the setting's")
    group.add_argument(
        "--gamma", type=float, metavar="G", help="outliers to inliers, instead of the setting's"
    )
    group.add_argument("--epsilon", type=float, metavar="E", help="mm², instead of the setting's")


def settings_of(args: argparse.Namespace, default: JrmpcSettings) -> JrmpcSettings:
    """Return the settings of JRMPC that were asked for."""
    named = default if args.settings is None else SETTINGS[args.settings]
    numbers = {name: getattr(args, name) for name in ("max_iterations", "gamma", "epsilon")}
    return replace(named, **{name: value for name, value in numbers.items() if value is not None})


def add_figure(parser: argparse.ArgumentParser) -> None:
    """Add ``--figure FILE``."""
    parser.add_argument("--figure", metavar="FILE", help="draw the result here (.png, .pdf or .svg)")


def save_figure_of(path: str | None, drawing: str, *content: Any) -> None:
    """Draw and write a figure where ``--figure`` was given; matplotlib is loaded only then."""
    if path is None:
        return
    from gp_core.study import figures

    figures.save_figure(getattr(figures, drawing)(*content), path)

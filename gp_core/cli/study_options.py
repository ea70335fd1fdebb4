"""Options that the commands of the study share: features, JRMPC settings, workers, figures."""

from __future__ import annotations

import argparse
import math
import sys
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np

from gp_core.constants import METHODS
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, EXTERNAL, PROBE, TRAINING, check_codes
from gp_core.registration.jrmpc import DEFAULTS, ESTIMATION, JrmpcSettings
from gp_core.study.backward_elimination import SearchProgress
from gp_core.study.parallel import open_executor

__all__ = [
    "ProgressLine",
    "add_features",
    "add_figure",
    "add_method",
    "add_seed",
    "add_settings",
    "add_workers",
    "codes_of",
    "executor_of",
    "features_of",
    "rng_of",
    "save_figure_of",
    "settings_of",
]

_SECONDS_BETWEEN_LINES = 20.0

SETTINGS = {"estimation": ESTIMATION, "defaults": DEFAULTS}


def add_features(parser: argparse.ArgumentParser) -> None:
    """Add ``--training`` and ``--probe``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
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
    """Return the requested training and probe features.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    training, probe : tuple of str
        By default the paper's.
    """
    training = codes_of(args.training, "--training", TRAINING, CODES)
    return training, codes_of(args.probe, "--probe", PROBE, tuple(c for c in EXTERNAL if c in training))


def codes_of(
    words: list[str] | None, option: str, default: tuple[str, ...], everything: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the features that an option names, separated by blanks or commas.

    Parameters
    ----------
    words : list of str or None
        Values of the option.
    option : str
        For messages.
    default : tuple of str
        Without the option.
    everything : tuple of str
        What ``all`` stands for.

    Returns
    -------
    tuple of str
        Feature codes.
    """
    if words is None:
        return default
    codes = [code for word in words for code in word.split(",") if code]
    return everything if [code.lower() for code in codes] == ["all"] else check_codes(codes, option)


def add_method(parser: argparse.ArgumentParser) -> None:
    """Add ``--method``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument("--method", choices=METHODS, default="jrmpc", help="default: jrmpc, as in the paper")


def add_settings(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the settings of JRMPC: one of two presets by name, and three numbers.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    default : str
        Name of the default preset.
    """
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
    """Return the requested settings of JRMPC.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.
    default : JrmpcSettings
        Without the options.

    Returns
    -------
    JrmpcSettings
        The settings.
    """
    named = default if args.settings is None else SETTINGS[args.settings]
    numbers = {name: getattr(args, name) for name in ("max_iterations", "gamma", "epsilon")}
    return replace(named, **{name: value for name, value in numbers.items() if value is not None})


def add_seed(parser: argparse._ActionsContainer) -> None:
    """Add ``--seed``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument("--seed", type=int, default=0, help="seed of the random numbers; default: 0")


def rng_of(args: argparse.Namespace) -> np.random.Generator:
    """Return the requested random number generator.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    numpy Generator
        Seeded.

    Raises
    ------
    GpError
        The seed is negative.
    """
    if args.seed < 0:
        raise GpError(f"the seed must be 0 or more, got {args.seed}")
    return np.random.default_rng(args.seed)


def add_workers(parser: argparse.ArgumentParser, *, default: int | None = None) -> None:
    """Add ``--workers`` and ``--scheduler``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    default : int, optional
        Default number of workers.
    """
    shown = "one per core" if default is None else f"{default}"
    parser.add_argument(
        "--workers", type=int, default=default, metavar="N", help=f"processes to use; default: {shown}"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster instead, such as tcp://host:8786"
    )


def executor_of(args: argparse.Namespace) -> AbstractContextManager[Executor | None]:
    """Return the requested executor, to be opened by ``with``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    context manager
        Of an executor, or of None where everything runs here.
    """
    return open_executor(args.workers, args.scheduler)


class ProgressLine:
    """Says on stderr how far a study is: in one line of a terminal, elsewhere in a line now and then."""

    def __init__(self) -> None:
        self._live = sys.stderr.isatty()
        self._shown = False
        self._next = _SECONDS_BETWEEN_LINES

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(self, *_: object) -> None:
        if self._live and self._shown:
            sys.stderr.write("\n")

    def __call__(self, progress: SearchProgress) -> None:
        """Show the progress."""
        if not self._live and progress.seconds < self._next:
            return
        self._next = progress.seconds + _SECONDS_BETWEEN_LINES
        left = "" if math.isnan(progress.left) else f", {_duration(progress.left)} left"
        text = f"{100 * progress.fraction:3.0f} %  {progress.text}, {progress.fits} estimates{left}"
        sys.stderr.write(f"\r{text:<100}" if self._live else f"{text}\n")
        sys.stderr.flush()
        self._shown = True


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"


def add_figure(parser: argparse._ActionsContainer) -> None:
    """Add ``--figure FILE``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument("--figure", metavar="FILE", help="draw the result here (.png, .pdf or .svg)")


def save_figure_of(path: str | None, drawing: str, *content: Any) -> None:
    """Draw and write a figure, if ``--figure`` was given; matplotlib is imported only then.

    Parameters
    ----------
    path : str or None
        Value of the option.
    drawing : str
        Name of a function in `gp_core.study.figures`.
    *content : object
        Its arguments.
    """
    if path is None:
        return
    from gp_core.study import figures

    figures.save_figure(getattr(figures, drawing)(*content), path)

"""Where both programs of the frozen application begin; which one it is, its file name says."""

import multiprocessing
import runpy
import sys
from pathlib import Path


def _run_as_python(words: list[str]) -> bool:
    """Do what the programs ask a Python of their own to do: ``[-X OPTION] -c CODE`` or ``-m MODULE``."""
    while words[:1] == ["-X"]:
        words = words[2:]
    if len(words) < 2 or words[0] not in ("-c", "-m"):
        return False
    sys.argv = words[1:]
    if words[0] == "-m":
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        exec(compile(words[1], "<string>", "exec"), {"__name__": "__main__"})
    return True


if __name__ == "__main__":
    multiprocessing.freeze_support()
    if not _run_as_python(sys.argv[1:]):
        from gp_labeler.cli.start import core, labeler

        sys.exit(core() if Path(sys.executable).stem == "gp-core" else labeler())

"""Numbers with decimal points, whatever the locale of the machine."""

from __future__ import annotations

import locale
import os
from contextlib import suppress

__all__ = ["use_plain_numbers"]

_LETTERS = ("C.UTF-8", "C.utf8", "en_US.UTF-8", "C")


def use_plain_numbers() -> None:
    """Read and write numbers as ``0.5`` in this process and its children, in C libraries too.

    Qt calls ``setlocale(LC_ALL, "")`` when the application is made; in a decimal-comma locale ITK and VTK
    would then read ``0.50075`` up to the point. Letters go by the C locale as well: PySide finds the setter
    of a property by ``toupper``, which in Turkish knows no ``I`` for ``i``. Call it before and after a
    library that sets the locale.
    """
    os.environ["LC_NUMERIC"] = "C"
    locale.setlocale(locale.LC_NUMERIC, "C")
    for name in _LETTERS:
        with suppress(locale.Error):
            locale.setlocale(locale.LC_CTYPE, name)
            return

"""The window without a display, driven by a script: `script`, `runner`, `batch`, `demo`."""

from gp_labeler.system.qt_binding import choose_binding

choose_binding()

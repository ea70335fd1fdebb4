"""Qt widgets: they show what `Session` holds and pass on what a person does; no numbers are computed here."""

from gp_labeler.system.qt_binding import choose_binding

choose_binding()

"""Qt widgets: they show what document and models hold, and pass on what a person does."""

from gp_labeler.system.qt_binding import choose_binding

choose_binding()

"""What commands do that need the window: ask for files, show dialogs, move the views; one module a menu.

Each module ends with a table of its commands, by id. A command that needs only the models is done by its row
in `gp_labeler.commands` instead.
"""

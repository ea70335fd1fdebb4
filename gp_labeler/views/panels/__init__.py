"""The panels beside the views and the dialogs: each shows one thing of a `Workbench`, and passes on clicks."""
